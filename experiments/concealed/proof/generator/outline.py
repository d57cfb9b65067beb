"""The outline of a sheet, measured along itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Outline:
    """A closed polygon; places on it are told by their way (m) along it from its first corner, in its own order."""

    def __init__(self, corner_m: Array) -> None:
        self.corner_m = corner_m
        self.wall_m = np.roll(corner_m, -1, axis=0) - corner_m
        self.begin_m = np.concatenate([[0.0], np.cumsum(np.hypot(*self.wall_m.T))])

    @property
    def length_m(self) -> float:
        """Once round."""
        return float(self.begin_m[-1])

    def nearest(self, point_m: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """The wall nearest to each point (n,2), the share of it to the place nearest, and the distance to that (m)."""
        point = point_m[:, None]
        share = ((point - self.corner_m) * self.wall_m).sum(axis=2) / (self.wall_m**2).sum(axis=1)
        share = np.clip(share, 0, 1)
        distance = np.hypot(*(self.corner_m + share[..., None] * self.wall_m - point).transpose(2, 0, 1))
        wall = distance.argmin(axis=1)
        row = np.arange(len(wall))
        return wall, share[row, wall], distance[row, wall]

    def direction(self, point_m: Array) -> Array:
        """Unit direction (2,) of the wall nearest to one point (2,)."""
        wall = self.wall_m[self.nearest(point_m[None])[0][0]]
        return np.asarray(wall / np.hypot(*wall))

    def way(self, point_m: Array) -> Array:
        """(n,) how far along the outline the places nearest to points (n,2) lie."""
        wall, share, _ = self.nearest(point_m)
        return np.asarray(self.begin_m[wall] + share * np.diff(self.begin_m)[wall])

    def at(self, way_m: Array) -> Array:
        """(n,2) places so far along the outline, more than once round too."""
        closed = np.concatenate([self.corner_m, self.corner_m[:1]])
        return np.stack([np.interp(way_m % self.length_m, self.begin_m, axis) for axis in closed.T], axis=1)
