"""A coupon's compression test made ready to fit: what the plates really did, the cycles, which of them are fast."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.measurement import Coupon
from ertskin.physics.effects.effect import Strokes

Array = NDArray[np.float64]

SAMPLES = 3000
PAUSE = 3.0
"""Times the usual interval between two updates of the gap, from which the plates are taken to have stood still."""
AIR = 0.05
"""Part of the deepest compression below which the plates are taken to have left the foam."""


@dataclass(frozen=True, eq=False)
class Compression:
    """A test thinned to N samples: time and force (N,), the cycle each belongs to, which are fast cycles.

    ``gap_time_s`` and ``gap_sink_m`` (M,) are the corners of the plates' way; compression is positive.
    """

    time_s: Array
    force_n: Array
    cycle: NDArray[np.int64]
    fast: NDArray[np.bool_]
    gap_time_s: Array
    gap_sink_m: Array
    height_m: float
    area_m2: float

    def sink_m(self, latency_s: float = 0.0) -> Array:
        """(N,) compression in metre where the gap is written down ``latency_s`` after the force."""
        return np.asarray(np.interp(self.time_s + latency_s, self.gap_time_s, self.gap_sink_m))

    def strokes(self, latency_s: float = 0.0) -> Strokes:
        """What the foam went through."""
        sink, count = np.maximum(self.sink_m(latency_s), 0.0), len(self.time_s)
        place = np.zeros(count, dtype=np.intp)
        return Strokes(sink, sink, self.time_s, np.ones(count, dtype=bool), place, self.cycle, self.height_m)


def prepared(coupon: Coupon, samples: int = SAMPLES) -> Compression:
    """A test of a coupon; cycles are told apart where the compression turns, fast ones by their speed.

    What follows after the plates have left the foam for good is no test of it.
    """
    time_s, force = np.asarray(coupon.time_s, dtype=float), np.asarray(coupon.force_n, dtype=float)
    sink = coupon.height_m - np.asarray(coupon.gap_m, dtype=float)
    good = np.isfinite(sink) & np.isfinite(force) & np.isfinite(time_s)
    time_s, force, sink = time_s[good], force[good], sink[good]
    corner_s, corner_m = plates_way(time_s, sink)
    sink = np.interp(time_s, corner_s, corner_m)
    end = 1 + int(np.flatnonzero(sink > AIR * sink.max())[-1]) if sink.max() > 0 else len(sink)
    time_s, force, sink = time_s[:end], force[:end], sink[:end]
    cycle = _cycles(sink, sink.max())
    fast = np.arange(len(sink)) < _slow_start(time_s, sink, cycle)
    kept = np.unique(np.linspace(0, len(sink) - 1, samples).astype(int))
    return Compression(
        time_s[kept], force[kept], cycle[kept], fast[kept], corner_s, corner_m, coupon.height_m, coupon.area_m2
    )


def plates_way(time_s: Array, sink_m: Array) -> tuple[Array, Array]:
    """Corners (M,), (M,) of the plates' way from a gap that is updated more rarely than the force is read.

    Between updates the plates move on evenly. Over a pause the record keeps the value before they stopped: where the
    next update lies ahead in the direction of travel, they went there at once and waited.
    """
    update = np.flatnonzero(np.diff(sink_m, prepend=np.nan) != 0)
    at, to = time_s[update], sink_m[update]
    if len(update) < 3:
        return time_s, sink_m
    usual = float(np.median(np.diff(at)))
    corner_s, corner_m = [at[0]], [to[0]]
    for k in range(1, len(at)):
        if at[k] - at[k - 1] > PAUSE * usual:
            pace = (to[k - 1] - to[k - 2]) / (at[k - 1] - at[k - 2]) if k > 1 else 0.0
            left = (to[k] - to[k - 1]) / pace if pace != 0 else -1.0
            ahead = 0 < left < PAUSE * usual
            corner_s.append(at[k - 1] + left if ahead else at[k] - usual)
            corner_m.append(to[k] if ahead else to[k - 1])
        corner_s.append(at[k])
        corner_m.append(to[k])
    return np.array(corner_s), np.array(corner_m)


def _cycles(sink_m: Array, depth_m: float) -> NDArray[np.int64]:
    """(N,) number of the loading cycle each sample belongs to; a new one begins where the compression is least."""
    number, low = 0, 0
    cycle = np.zeros(len(sink_m), dtype=np.int64)
    waiting = False
    for k, s in enumerate(sink_m):
        if s < 0.25 * depth_m:
            low = k if not waiting or s <= sink_m[low] else low
            waiting = True
        elif waiting and s > 0.5 * depth_m:
            number += 1
            cycle[low:k] = number
            waiting = False
        cycle[k] = number
    return cycle


def _slow_start(time_s: Array, sink_m: Array, cycle: NDArray[np.int64]) -> int:
    """First sample of a last cycle that loads at less than 0.7 of the usual pace; their number without one."""
    pace = []
    for number in np.unique(cycle)[1:]:
        mine = np.flatnonzero(cycle == number)
        top = mine[: int(np.argmax(sink_m[mine] > 0.95 * sink_m[mine].max())) + 1]
        pace.append((sink_m[top[-1]] - sink_m[top[0]]) / max(time_s[top[-1]] - time_s[top[0]], 1e-9))
    if len(pace) > 2 and pace[-1] < 0.7 * np.median(pace[:-1]):
        return int(np.flatnonzero(cycle == cycle.max())[0])
    return len(sink_m)
