"""What was done to the skin, frame by frame: the input of the forward chain."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

SPOT_M = 1e-3
"""Contacts closer together than this press the same spot of foam."""


class Phase(IntEnum):
    """What the stage is doing during a frame."""

    REST = 0
    LOADING = 1
    HOLD = 2
    UNLOADING = 3


@dataclass(frozen=True, eq=False)
class History:
    """T frames with up to P contacts each, in recording order.

    ``time_s`` (T,) start of the scan; ``press`` (T,) which press a frame belongs to; ``phase`` (T,) of ``Phase``;
    ``contact_m`` (T,P,2) commanded indenter positions, NaN where there is none; ``depth_m`` (T,P) commanded stage
    depth; ``force_n`` (T,P) load-cell force, NaN where not known.
    """

    time_s: Array
    press: NDArray[np.int64]
    phase: NDArray[np.uint8]
    contact_m: Array
    depth_m: Array
    force_n: Array

    @classmethod
    def of_presses(cls, contact_m: ArrayLike, force_n: ArrayLike, *, frames: int = 1, step_s: float = 1.0) -> History:
        """N presses at places (N,2) or (N,P,2) in metre with forces (N,) or (N,P) in newton.

        Each is held for ``frames`` scans after one at rest, and the skin is left at rest; scans begin every ``step_s``
        seconds. Depths are not known.
        """
        contact = np.asarray(contact_m, dtype=float)
        contact = contact.reshape(len(contact), -1, 2)
        presses, contacts = contact.shape[:2]
        force: Array = np.asarray(force_n, dtype=float).reshape(presses, contacts)
        phase = np.append(np.tile([Phase.REST] + [Phase.HOLD] * frames, presses), Phase.REST).astype(np.uint8)
        press = np.minimum(np.arange(len(phase)) // (frames + 1), presses)
        held = (phase == Phase.HOLD)[:, None]
        # The last frame belongs to no press; what is looked up for it is then left out.
        of_press = np.minimum(press, presses - 1)
        return cls(
            step_s * np.arange(len(phase), dtype=float),
            press.astype(np.int64),
            phase,
            np.where(held[..., None], contact[of_press], np.nan),
            np.full((len(phase), contacts), np.nan),
            np.where(held, force[of_press], np.nan),
        )

    def __len__(self) -> int:
        return len(self.time_s)

    def __getitem__(self, frames: slice | NDArray[np.bool_] | NDArray[np.intp]) -> History:
        """The frames selected, as a history of their own."""
        return History(
            self.time_s[frames],
            self.press[frames],
            self.phase[frames],
            self.contact_m[frames],
            self.depth_m[frames],
            self.force_n[frames],
        )

    @cached_property
    def step_m(self) -> float:
        """Metre by which the stage usually goes deeper from one frame of a press to the next, NaN where it never
        does."""
        deeper = np.diff(self.depth_m, axis=0)[(self.phase[1:] == Phase.LOADING) & (np.diff(self.press) == 0)]
        deeper = deeper[np.isfinite(deeper) & (deeper > 0)]
        return float(np.median(deeper)) if deeper.size else float("nan")

    @cached_property
    def touched(self) -> NDArray[np.bool_]:
        """(T,P) where a contact presses: neither a rest frame nor an absent contact."""
        return np.isfinite(self.contact_m).all(axis=-1) & (self.phase != Phase.REST)[:, None]

    @cached_property
    def spot(self) -> NDArray[np.intp]:
        """(T,P) number of the spot that each contact presses, -1 where there is none."""
        numbers = np.full(self.contact_m.shape[:-1], -1, dtype=np.intp)
        touching = np.isfinite(self.contact_m).all(axis=-1)
        spots = np.round(self.contact_m[touching] / SPOT_M).astype(np.int64)
        if len(spots):
            numbers[touching] = np.unique(spots, axis=0, return_inverse=True)[1].ravel()
        return numbers
