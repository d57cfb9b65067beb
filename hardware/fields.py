"""Fields of an HDF5 file, taken with their shape, kind and finiteness checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.clean_copy import UNREADABLE
from ertskin.hardware.measurement import RecordingError

Dim = int | str | None
"""A length, or a letter standing for any length, or None for any."""


@dataclass(frozen=True)
class Fields:
    """The fields of one group of the file at ``path``; every refusal names file, field, found and expected."""

    path: Path
    group: h5py.Group
    name: str = ""

    def refuse(self, field: str, found: str, expected: str) -> RecordingError:
        """The error to raise for ``field`` of this group."""
        return RecordingError(f"{self.path}: {self.name}/{field}: found {found}, expected {expected}")

    def __contains__(self, field: str) -> bool:
        return field in self.group or field in self.group.attrs

    def subgroup(self, field: str) -> Fields | None:
        """The group named, or None where the file has none."""
        if field not in self.group:
            return None
        child = self.group[field]
        if not isinstance(child, h5py.Group):
            raise self.refuse(field, "a dataset", "a group")
        return Fields(self.path, child, f"{self.name}/{field}")

    def dataset(self, field: str) -> h5py.Dataset:
        """The dataset itself, unread."""
        self._refuse_unreadable(field)
        if field not in self.group:
            raise self.refuse(field, "nothing", "a dataset")
        item = self.group[field]
        if not isinstance(item, h5py.Dataset):
            raise self.refuse(field, "a group", "a dataset")
        return item

    def _refuse_unreadable(self, field: str) -> None:
        if UNREADABLE + field in self.group.attrs:
            raise self.refuse(field, str(self.group.attrs[UNREADABLE + field]), "intact data")

    def numbers(
        self,
        field: str,
        shape: Sequence[Dim],
        dtype: type = np.float64,
        *,
        finite: bool = True,
        rows: int | None = None,
    ) -> NDArray[np.generic]:
        """The dataset as an array of ``dtype``; ``rows`` takes no more than the first so many.

        Raises ``RecordingError`` for a field that is missing, of another shape, not numeric, fractional where whole
        numbers belong, not finite (unless ``finite`` is false), or larger than the file could hold.
        """
        item = self.dataset(field)
        if item.dtype.kind not in "fiub":
            raise self.refuse(field, f"values of type {item.dtype}", "numbers")
        self._check_shape(field, item.shape, shape)
        values = item[()] if rows is None else item[:rows]
        return self._checked(field, np.asarray(values), dtype, finite)

    def _checked(self, field: str, values: NDArray[np.generic], dtype: type, finite: bool) -> NDArray[np.generic]:
        if values.dtype.kind == "f" and finite and not np.isfinite(values).all():
            bad = np.argwhere(~np.isfinite(values))
            place = tuple(int(k) for k in bad[0])
            raise self.refuse(field, f"{len(bad)} values NaN or infinite (first at {place})", "finite numbers")
        if np.issubdtype(dtype, np.integer) and values.dtype.kind == "f" and (values.astype(float) % 1.0).any():
            raise self.refuse(field, "fractions", "whole numbers")
        return np.ascontiguousarray(values.astype(dtype, copy=False))

    def _check_shape(self, field: str, found: tuple[int, ...], expected: Sequence[Dim]) -> None:
        fits = len(found) == len(expected) and all(
            not isinstance(want, int) or have == want for have, want in zip(found, expected, strict=False)
        )
        if not fits:
            wanted = ", ".join("any" if dim is None else str(dim) for dim in expected)
            raise self.refuse(field, f"shape {tuple(found)}", f"shape ({wanted})")

    def number(self, field: str, default: float | None = None, *, optional: bool = False) -> float | None:
        """A finite scalar attribute; ``default`` where it is missing (``optional`` lets that be None)."""
        self._refuse_unreadable(field)
        if field not in self.group.attrs:
            if default is None and not optional:
                raise self.refuse(field, "nothing", "a number (attribute)")
            return default
        value = np.asarray(self.group.attrs[field])
        if value.size != 1 or value.dtype.kind not in "fiub":
            raise self.refuse(field, f"{value.dtype} of shape {value.shape}", "one number (attribute)")
        if not np.isfinite(value).all():
            raise self.refuse(field, str(value.item()), "a finite number (attribute)")
        return float(value.item())

    def whole(self, field: str, default: int | None = None) -> int:
        """A whole number in an attribute."""
        value = self.number(field, default)
        if value is None or value != round(value):
            raise self.refuse(field, str(value), "a whole number (attribute)")
        return round(value)

    def attribute(self, field: str, length: int) -> NDArray[np.float64]:
        """A vector attribute of ``length`` finite numbers."""
        self._refuse_unreadable(field)
        value = np.asarray(self.group.attrs[field])
        if value.shape != (length,) or value.dtype.kind not in "fiu" or not np.isfinite(value.astype(float)).all():
            raise self.refuse(field, f"{value.dtype} of shape {value.shape}", f"{length} finite numbers (attribute)")
        return value.astype(float)

    def text(self, field: str, default: str | None = None) -> str:
        """A string attribute; ``default`` where it is missing."""
        self._refuse_unreadable(field)
        if field not in self.group.attrs:
            if default is None:
                raise self.refuse(field, "nothing", "a text (attribute)")
            return default
        value = self.group.attrs[field]
        if isinstance(value, bytes | np.bytes_):
            return bytes(value).decode("utf-8", "replace")
        if not isinstance(value, str):
            raise self.refuse(field, f"{value!r}", "a text (attribute)")
        return str(value)


def first_line(error: BaseException) -> str:
    """The first line of an exception's text."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
