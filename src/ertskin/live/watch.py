"""A skin watched scan by scan: is it at rest, what became of it since its calibration, and is it still what it was."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ertskin.models.estimate import Estimate
from ertskin.models.monitor import SkinMonitor
from ertskin.models.novelty import unexplained_of
from ertskin.physics.calibration.following import RestState
from ertskin.physics.protocol import Protocol
from ertskin.physics.scan_reduction import ScanReduction

Array = NDArray[np.float64]

LOOKED_BACK, TOO_MANY = 20, 3
"""A skin has left what was trained where so many of the last touched frames lie beyond a limit that one in a thousand
exceeds by chance: by chance in one of a million such stretches."""


@dataclass(frozen=True, eq=False)
class SeenScan:
    """A scan as it would have read on the skin at its calibration.

    ``clean_v`` (R,): the readings since the zeroing, without spikes; ``offset_v`` (R,): what the resting skin's have
    moved by since. ``coordinates_v`` (n,) of the change against rest; ``as_read_v`` (n,) of the scan itself.
    ``unexplained``: mean square of what no resistor network could give. ``state``: of the resting skin at its time.
    """

    clean_v: Array
    offset_v: Array
    coordinates_v: Array
    unexplained: float
    state: RestState
    as_read_v: Array

    @cached_property
    def surprise(self) -> float:
        """How far it is from what a resting skin, followed so far, reads, 1 being the limit."""
        return self.state.surprise(self.as_read_v) / self.state.skin.limit

    @cached_property
    def at_rest(self) -> bool:
        """Whether it is what a resting skin, followed so far, may read."""
        return self.state.unexplained(self.as_read_v) <= self.state.skin.limit and self.surprise <= 1.0

    @property
    def change_v(self) -> NDArray[np.float32]:
        """(R,) of the readings against rest."""
        return ((self.clean_v - self.offset_v) / self.state.gain).astype(np.float32)


class Watch:
    """Follows one skin from its zeroing on."""

    def __init__(self, monitor: SkinMonitor, protocol: Protocol) -> None:
        self.monitor = monitor
        self._reduction = ScanReduction(protocol, monitor.novelty.noise_v)
        self._shape = protocol.shape
        self._beyond: deque[bool] = deque(maxlen=LOOKED_BACK)
        self.left = False
        """Whether the skin has left what was trained."""

    def begin(self, scans_v: Array, time_s: Array) -> None:
        """Zero on untouched scans (T,K,M); what else was known of the skin is forgotten."""
        flat = scans_v.reshape(len(scans_v), -1)
        self._first_v, self._frames = flat.mean(axis=0), len(flat)
        self._first_coordinates_v = self._reduction.coordinates(self._first_v)
        self._state = RestState.unknown(self.monitor.resting, float(time_s[0]))
        for scan, time in zip(flat, time_s, strict=True):
            change, _, _ = self._reduction.despiked(scan - self._first_v)
            self._take(self._state.at(float(time)), change + self._first_coordinates_v)
        self._beyond.clear()
        self.left = False

    @property
    def state(self) -> RestState:
        """Of the resting skin after the last frame that was at rest."""
        return self._state

    def see(self, scan_v: NDArray[np.floating], time_s: float) -> SeenScan:
        """A scan (K,M) beside what the resting skin would read."""
        moved, clean, leftover = self._reduction.despiked(scan_v.ravel() - self._first_v)
        state = self._state.at(time_s)
        as_read = moved + self._first_coordinates_v
        unexplained = unexplained_of(leftover[None], self.monitor.novelty.noise_v, self._reduction.spare, self._frames)
        return SeenScan(
            clean,
            self._offset_v,
            (as_read - state.zero_v) / state.gain,
            float(unexplained[0]),
            state,
            as_read,
        )

    def judged(self, seen: SeenScan, estimate: Estimate) -> tuple[float, bool]:
        """How unlike trained frames it is, 1 being the limit, and whether the skin is at rest, which is then followed:
        how unlike a resting skin. Contacts that explain a frame worse than a faster drift does are none."""
        if seen.at_rest:
            self._take(seen.state, seen.as_read_v)
            return seen.surprise, True
        score = self.monitor.novelty.score(
            seen.coordinates_v[None],
            estimate.misfit,
            np.array([seen.unexplained]),
            seen.state.zero_variance,
        )
        if score[0] > 1.0 or not estimate.present.any():
            loose = seen.state.loosened()
            surprise = loose.surprise(seen.as_read_v) / self.monitor.resting.limit
            if surprise <= 1.0:
                self._take(loose, seen.as_read_v)
                return surprise, True
        self._beyond.append(bool(score[0] > 1.0))
        beyond = sum(self._beyond)
        self.left = beyond >= TOO_MANY or (self.left and beyond > 0)
        return float(score[0]), False

    def _take(self, state: RestState, coordinates_v: Array) -> None:
        self._state = state.updated(coordinates_v)
        self._offset_v = self._reduction.readings(self._state.zero_v - self._first_coordinates_v)
