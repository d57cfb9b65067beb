"""An emulated stage's motion: straight moves one after another, each at its own even speed."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Leg:
    """A straight piece of the path; a dwell where both ends are one place."""

    begin_s: float
    end_s: float
    begin_m: Array
    end_m: Array

    def at(self, time_s: float) -> Array:
        """(3,) the place at a time; the ends before and after."""
        if self.end_s <= self.begin_s:
            return self.end_m
        share = min(1.0, max(0.0, (time_s - self.begin_s) / (self.end_s - self.begin_s)))
        return self.begin_m + share * (self.end_m - self.begin_m)


class Axes:
    """Three axes without inertia: where they were, are and are going."""

    def __init__(self, position_m: tuple[float, float, float]) -> None:
        start = np.array(position_m, dtype=float)
        self._legs = [Leg(-np.inf, 0.0, start, start)]

    @property
    def end_s(self) -> float:
        """When the last leg ends."""
        return self._legs[-1].end_s

    @property
    def end_m(self) -> Array:
        """(3,) where the last leg ends."""
        return self._legs[-1].end_m

    def pending(self, time_s: float) -> int:
        """Legs not yet ended."""
        return sum(leg.end_s > time_s for leg in self._legs)

    def at(self, time_s: float) -> Array:
        """(3,) where the axes are."""
        later = bisect_right([leg.begin_s for leg in self._legs], time_s)
        return self._legs[max(0, later - 1)].at(time_s)

    def go(self, target_m: Array, speed_m_s: float, now_s: float) -> None:
        """Add a move behind what is under way."""
        distance = float(np.linalg.norm(target_m - self.end_m))
        self._add(target_m, distance / speed_m_s, now_s)

    def dwell(self, seconds: float, now_s: float) -> None:
        """Add a rest behind what is under way."""
        self._add(self.end_m, seconds, now_s)

    def stop(self, now_s: float) -> None:
        """Stand where they are; forget the rest."""
        position_m = self.at(now_s)
        kept = [leg for leg in self._legs if leg.begin_s < now_s]
        last = kept[-1]
        if last.end_s > now_s:
            kept[-1] = Leg(last.begin_s, now_s, last.begin_m, position_m)
        self._legs = kept

    def path_m(self, since_s: float, until_s: float) -> list[tuple[float, Array]]:
        """(time, place) at every turn in (since, until], and at ``until``; older legs are forgotten."""
        turns = [
            (time_s, self.at(time_s))
            for leg in self._legs
            for time_s in (leg.begin_s, leg.end_s)
            if since_s < time_s < until_s
        ]
        self._legs = [leg for leg in self._legs[:-1] if leg.end_s >= since_s] + self._legs[-1:]
        return [*turns, (until_s, self.at(until_s))]

    def _add(self, target_m: Array, seconds: float, now_s: float) -> None:
        begin = max(now_s, self.end_s)
        self._legs.append(Leg(begin, begin + seconds, self.end_m, np.array(target_m, dtype=float)))
