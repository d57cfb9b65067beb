"""Places along a sheet's rim, by the length of the outline from its first corner."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def sides(outline_m: Array) -> tuple[Array, Array, Array]:
    """Start points, vectors and lengths of a closed polygon's sides."""
    vector = np.roll(outline_m, -1, axis=0) - outline_m
    return outline_m, vector, np.hypot(vector[:, 0], vector[:, 1])


def arc_position(outline_m: Array, point: Array) -> tuple[Array, Array]:
    """(n,) arc lengths of the outline's points next to points (n,2), from its first corner, and (n,) how far off."""
    start, vector, length = sides(outline_m)
    before = np.concatenate([[0.0], np.cumsum(length)[:-1]])
    along = np.clip(((point[:, None] - start) * vector).sum(axis=2) / length**2, 0.0, 1.0)
    off = point[:, None] - start - along[..., None] * vector
    distance = np.hypot(off[..., 0], off[..., 1])
    side, rows = distance.argmin(axis=1), np.arange(len(point))
    return (before[side] + along[rows, side] * length[side]) % length.sum(), distance[rows, side]


def on_outline(outline_m: Array, arc_m: Array | float) -> Array:
    """(n,2) points of the outline at arc lengths from 0 to its whole length."""
    start, vector, length = sides(outline_m)
    corner = np.concatenate([[0.0], np.cumsum(length)])
    arc = np.atleast_1d(arc_m)
    side = np.clip(np.searchsorted(corner, arc, side="right") - 1, 0, len(length) - 1)
    return np.asarray(start[side] + ((arc - corner[side]) / length[side])[:, None] * vector[side])


def moved_along(outline_m: Array, edge_m: Array, along_m: Array) -> Array:
    """(L,2,2) ends of stretches ``edge_m`` of the outline, each moved ``along_m`` (L,) in the outline's order."""
    around = sides(outline_m)[2].sum()
    arc = np.stack([arc_position(outline_m, edge_m[:, end])[0] + along_m for end in range(2)], axis=1)
    moved = on_outline(outline_m, arc.ravel() % around).reshape(edge_m.shape)
    return np.where(along_m[:, None, None] == 0, edge_m, moved)
