"""Columns of one length: what a table of a recording is made of."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.importing.entry import Source

Array = NDArray[np.float64]
Part = dict[str, Any]


def times_s(fields: Part, length: int, part: str, source: Source) -> Array:
    """(length,) seconds: those given, or evenly spaced with ``time_s: {step: SECONDS}``."""
    given = fields.get("time_s")
    if given is None:
        raise source.refuse(f"{part}.time_s", "missing; readings evenly spaced in time: time_s: {step: SECONDS}")
    if isinstance(given, dict):
        if set(given) != {"step"}:
            raise source.refuse(f"{part}.time_s", f"found {given}, expected {{from: NAME}} or {{step: SECONDS}}")
        return float(given["step"]) * np.arange(length, dtype=float)
    (time,) = columns(fields, ("time_s",), part, source)
    return time


def columns(fields: Part, names: tuple[str, ...], part: str, source: Source) -> list[Array]:
    """The fields as columns of one length."""
    found: list[Array] = []
    for name in names:
        if name not in fields:
            raise source.refuse(f"{part}.{name}", "missing")
        column = np.asarray(fields[name], dtype=float).ravel()
        if found and len(column) != len(found[0]):
            raise source.refuse(
                f"{part}.{name}", f"found {len(column)} values, expected {len(found[0])} as in {names[0]}"
            )
        found.append(column)
    return found
