"""A graded conforming triangulation of a sheet: its outline, the rims of its pads, the ends of its edge electrodes.

Points are centres of quadtree cells no larger than the size wanted there, and points along every line to be kept;
Delaunay's triangulation keeps a line whose stretches have no point within their diameter circles, and stretches that
are lost are halved (Ruppert, J. Algorithms 18, 1995).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, cKDTree

from .outline import Outline

Array = NDArray[np.float64]
GRADING = 0.3
ON_M = 1e-7
"""An electrode's end no farther than this from the outline lies on it."""


@dataclass(frozen=True)
class Fineness:
    """Edge lengths (m): far from everything, at a pad's rim, at the end of an edge electrode."""

    far_m: float = 2.4e-3
    rim_m: float = 4.0e-4
    end_m: float = 6.0e-5


def inside(outline_m: Array, points_m: Array) -> NDArray[np.bool_]:
    """(n,) which points lie within a closed polygon (even-odd rule)."""
    a, b = outline_m, np.roll(outline_m, -1, axis=0)
    x, y = points_m[:, :1], points_m[:, 1:]
    crosses = (a[:, 1] > y) != (b[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = (b[:, 0] - a[:, 0]) * (y - a[:, 1]) / (b[:, 1] - a[:, 1]) + a[:, 0]
    return np.asarray((crosses & (x < at)).sum(axis=1) % 2 == 1)


def rims(center_m: Array, size_m: Array) -> Array:
    """(L,4,2) corners of pads, counter-clockwise."""
    corner = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.asarray(center_m[:, None] + corner * size_m[:, None])


class Sizes:
    """The edge length wanted at a place."""

    def __init__(self, pad_rims: Array, ends_m: Array, fineness: Fineness) -> None:
        self.fineness = fineness
        self.low = pad_rims.min(axis=1) if len(pad_rims) else np.zeros((0, 2))
        self.high = pad_rims.max(axis=1) if len(pad_rims) else np.zeros((0, 2))
        self.ends = cKDTree(ends_m) if len(ends_m) else None

    def __call__(self, points_m: Array) -> Array:
        """(n,) metres."""
        f = self.fineness
        size = np.full(len(points_m), f.far_m)
        for low, high in zip(self.low, self.high, strict=True):
            beyond = np.maximum(low - points_m, points_m - high)
            out = np.hypot(*np.maximum(beyond, 0.0).T)
            distance = np.where(out > 0, out, -beyond.max(axis=1))
            size = np.minimum(size, f.rim_m + GRADING * distance)
        if self.ends is not None:
            size = np.minimum(size, f.end_m + GRADING * self.ends.query(points_m)[0])
        return size


def _walk(start: Array, stop: Array, sizes: Sizes) -> Array:
    """Points from ``start`` (with it) to ``stop`` (without it), spaced as wanted along the way."""
    length = float(np.hypot(*(stop - start)))
    fine = np.linspace(0.0, 1.0, max(16, int(length / (0.25 * sizes.fineness.end_m)) + 1))
    if len(fine) > 20000:
        fine = np.linspace(0.0, 1.0, 20000)
    density = 1.0 / sizes(start + fine[:, None] * (stop - start))
    steps = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(fine) * length)])
    count = max(1, round(float(steps[-1])))
    at = np.interp(np.arange(count) * steps[-1] / count, steps, fine)
    return np.asarray(start + at[:, None] * (stop - start))


def _loop(corners: Array, sizes: Sizes) -> Array:
    return np.concatenate([_walk(a, b, sizes) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])


def _cells(low: Array, high: Array, sizes: Sizes) -> Array:
    """Centres of quadtree cells over a box."""
    edge = sizes.fineness.far_m
    count = np.ceil((high - low) / edge).astype(int)
    grid = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in count), indexing="ij"), axis=-1).reshape(-1, 2)
    # Rows are set half a cell apart: triangles come out nearer to equilateral than from squares.
    grid[:, 0] += 0.5 * (np.floor(grid[:, 1]) % 2) - 0.25
    cells, done = low + edge * grid, []
    while len(cells):
        split = edge > 1.25 * sizes(cells)
        done.append(cells[~split])
        edge *= 0.5
        corner = 0.5 * edge * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        cells = (cells[split][:, None] + corner).reshape(-1, 2)
    return np.concatenate(done)


def _split_lost(points: Array, lines: list[Array]) -> tuple[Array, Delaunay]:
    """Halve stretches of the lines that the triangulation lost, until none is."""
    for _ in range(12):
        cloud = np.concatenate([*lines, points])
        mesh = Delaunay(cloud)
        start, neighbours = mesh.vertex_neighbor_vertices
        first, lost = 0, False
        for number, line in enumerate(lines):
            indices, kept = first + np.arange(len(line)), []
            for i, j in zip(indices, np.roll(indices, -1), strict=True):
                kept.append(cloud[i])
                if j not in neighbours[start[i] : start[i + 1]]:
                    kept.append(0.5 * (cloud[i] + cloud[j]))
                    lost = True
            first += len(line)
            lines[number] = np.array(kept)
        if not lost:
            return cloud, mesh
    raise ValueError("the sheet can't be meshed: a pad lies too near to the outline or to another pad")


def triangulate(outline_m: Array, pad_rims: Array, ends_m: Array, fineness: Fineness) -> tuple[Array, NDArray[np.intp]]:
    """(n,2) points and (t,3) triangles of the sheet; edges follow outline and rims, ``ends_m`` are among the points."""
    sizes = Sizes(pad_rims, ends_m, fineness)
    corners = _with_ends(outline_m, ends_m)
    lines = [_loop(corners, sizes), *(_loop(rim, sizes) for rim in pad_rims)]
    free = _cells(outline_m.min(axis=0), outline_m.max(axis=0), sizes)
    free = free[inside(outline_m, free)]
    on_lines = np.concatenate([*lines, *(0.5 * (line + np.roll(line, -1, axis=0)) for line in lines)])
    distance, _ = cKDTree(on_lines).query(free)
    free = free[distance > 0.62 * sizes(free)]
    cloud, mesh = _split_lost(free, lines)
    corner = cloud[mesh.simplices]
    kept = inside(outline_m, corner.mean(axis=1))
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    kept &= np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > 1e-14
    used, triangles = np.unique(mesh.simplices[kept], return_inverse=True)
    return cloud[used], triangles.reshape(-1, 3)


def _with_ends(outline_m: Array, ends_m: Array) -> Array:
    """The outline with the ends of edge electrodes among its corners, in order."""
    if (Outline(outline_m).nearest(ends_m)[2] > ON_M).any():
        raise ValueError("an electrode's end doesn't lie on the outline")
    corners = []
    for a, b in zip(outline_m, np.roll(outline_m, -1, axis=0), strict=True):
        along, length = b - a, np.hypot(*(b - a))
        corners.append(a)
        if not len(ends_m):
            continue
        at = (ends_m - a) @ along / length**2
        off = np.abs((ends_m - a) @ np.array([-along[1], along[0]])) / length
        on = (off < ON_M) & (at > 1e-6) & (at < 1 - 1e-6)
        corners.extend(a + t * along for t in sorted(set(np.round(at[on], 9))))
    return np.array(corners)
