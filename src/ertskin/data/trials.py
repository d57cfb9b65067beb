"""Simulated trials in memory: the 276 numbers of each press beside the forces that caused it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.protocol import Protocol

if TYPE_CHECKING:
    from ertskin.data.touch_model import TouchModel

Array = NDArray[np.float64]
READINGS_AT_ONCE = 1024


@dataclass(frozen=True, eq=False)
class TrialSet:
    """N trials on one skin, free of noise; n taxels, up to C contacts, P pairs of electrodes. Forces in newton.

    ``change_ohm`` (N,P): pair resistances of the pressed skin less those at rest. ``force_map_n`` (N,n): the force on
    each taxel, 0 where there is none. ``contact_m`` (N,C,2) and ``force_n`` (N,C): the contacts, NaN for an absent
    one. ``measured_v`` (N,R): for trials with a counterpart on the real skin, its measured change of the R readings;
    rows of NaN, or no array at all, where there is none. ``touch``: the response the trials come from, where it is
    tabulated. Raises ``ValueError`` for lengths that differ.
    """

    change_ohm: Array
    force_map_n: Array
    contact_m: Array
    force_n: Array
    measured_v: NDArray[np.floating] | None = None
    touch: TouchModel | None = None

    def __post_init__(self) -> None:
        lengths = {
            f.name: len(value)
            for f in fields(self)
            if (value := getattr(self, f.name)) is not None and f.name != "touch"
        }
        if len(set(lengths.values())) > 1:
            raise ValueError(f"the arrays of a trial set must be equally long, got {lengths}")

    def __len__(self) -> int:
        return len(self.change_ohm)

    def __getitem__(self, rows: slice | NDArray[np.bool_] | NDArray[np.intp]) -> TrialSet:
        """The trials selected, as a set of their own."""
        measured = None if self.measured_v is None else self.measured_v[rows]
        return TrialSet(
            self.change_ohm[rows],
            self.force_map_n[rows],
            self.contact_m[rows],
            self.force_n[rows],
            measured,
            self.touch,
        )

    @property
    def contacts(self) -> NDArray[np.int64]:
        """(N,) contacts in each trial."""
        return np.isfinite(self.force_n).sum(axis=1)

    def coordinates_v(self, protocol: Protocol) -> Array:
        """(N,P) volt: the changes in the coordinates in which white reading noise stays white."""
        return protocol.whitened(self.change_ohm)

    def readings_v(self, protocol: Protocol) -> NDArray[np.float32]:
        """(N,R) volt: the changes of all readings, R = K*M (6624 for the paper's skin), in the files' precision."""
        readings = np.empty((len(self), protocol.design.shape[0]), dtype=np.float32)
        for start in range(0, len(self), READINGS_AT_ONCE):
            part = slice(start, start + READINGS_AT_ONCE)
            readings[part] = self.change_ohm[part] @ protocol.design.T
        return readings

    def readings_moments_v(self, protocol: Protocol) -> tuple[Array, Array]:
        """(R,) mean and (R,) standard deviation of the readings' changes, exactly, from those of the P numbers."""
        covariance = np.cov(self.change_ohm, rowvar=False, bias=True)
        variance = np.einsum("rp,rp->r", protocol.design @ covariance, protocol.design)
        return protocol.design @ self.change_ohm.mean(axis=0), np.sqrt(np.maximum(variance, 0.0))


def joined(sets: Sequence[TrialSet]) -> TrialSet:
    """All trials in order; contacts padded with NaN to the largest number, readings where only some are measured."""
    most = max(trials.force_n.shape[1] for trials in sets)
    measured = None
    width = {trials.measured_v.shape[1] for trials in sets if trials.measured_v is not None}
    if width:
        blank = width.pop()
        measured = np.concatenate(
            [np.full((len(t), blank), np.nan) if t.measured_v is None else t.measured_v for t in sets]
        )
    return TrialSet(
        np.concatenate([trials.change_ohm for trials in sets]),
        np.concatenate([trials.force_map_n for trials in sets]),
        np.concatenate([_padded(trials.contact_m, most) for trials in sets]),
        np.concatenate([_padded(trials.force_n, most) for trials in sets]),
        measured,
    )


def _padded(values: Array, contacts: int) -> Array:
    width = [(0, 0)] * values.ndim
    width[1] = (0, contacts - values.shape[1])
    return np.pad(values, width, constant_values=np.nan)
