"""A conforming triangle mesh of the sheet, graded towards the rims of pads and the ends of edge electrodes.

Current crowds at a pad's rim within sqrt(R area / R_sheet), 0.1 to 1 mm. Around every pad lies a block of lines
parallel to its sides, geometrically finer towards the rim, where the field varies fast across but slowly along.
A product grid is its own Delaunay triangulation however thin its cells, so one Delaunay call joins the blocks, a
graded quadtree of points between them and the outline.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.spatial import Delaunay, cKDTree

from ertskin.physics.rim import arc_position, on_outline, sides
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

NEAR_PADS = 16  # pads that can set the cell size at a point
LEAST_MARGIN = 0.02  # of half a pad: fifty lines across it; a narrower margin costs more than it is worth


class MeshError(ValueError):
    """The outline and electrodes can't be meshed as given."""


@dataclass(frozen=True, eq=False)
class SheetMesh:
    """Triangles and which of them, or of their edges on the outline, each electrode touches.

    ``point_m`` (N,2); ``triangle`` (E,3) counter-clockwise; ``pad`` (E,) electrode whose pad covers the element, -1
    for none; ``edge`` L arrays (n,2) of the mesh edges an edge electrode covers. An electrode has one or the other.
    """

    point_m: Array
    triangle: Indices
    pad: Indices
    edge: tuple[Indices, ...]

    @classmethod
    def from_nodes(cls, point_m: Array, triangle: Indices, electrode_nodes: Sequence[Indices]) -> SheetMesh:
        """A mesh made elsewhere whose edge electrodes are given by the outline's nodes they cover."""
        flipped = triangle_areas(point_m, triangle) < 0
        triangle = np.where(flipped[:, None], triangle[:, ::-1], triangle).astype(np.intp)
        side = np.sort(triangle[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, count = np.unique(side, axis=0, return_counts=True)
        outline = unique[count == 1]
        edge = tuple(outline[np.isin(outline, nodes).all(axis=1)] for nodes in electrode_nodes)
        return cls(point_m, triangle, np.full(len(triangle), -1), edge)

    def refined(self) -> SheetMesh:
        """Every triangle cut into four similar ones."""
        end = self.triangle[:, [[0, 1], [1, 2], [2, 0]]]
        unique, number = np.unique(np.sort(end, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
        middle = len(self.point_m) + number.reshape(-1, 3)
        a, b, c = self.triangle.T
        ab, bc, ca = middle.T
        triangle = np.stack([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]).transpose(2, 0, 1).reshape(-1, 3)
        code = unique[:, 0] * len(self.point_m) + unique[:, 1]
        edge = []
        for part in self.edge:
            low, high = np.sort(part, axis=1).T
            half = len(self.point_m) + np.searchsorted(code, low * len(self.point_m) + high)
            edge.append(np.concatenate([np.stack([part[:, 0], half], axis=1), np.stack([half, part[:, 1]], axis=1)]))
        point_m = np.concatenate([self.point_m, self.point_m[unique].mean(axis=1)])
        return SheetMesh(point_m, triangle, np.repeat(self.pad, 4), tuple(edge))

    @property
    def electrodes(self) -> int:
        """Number of electrodes L."""
        return len(self.edge)

    @property
    def area_m2(self) -> Array:
        """(E,) areas."""
        return triangle_areas(self.point_m, self.triangle)


@dataclass(frozen=True)
class Grading:
    """``cell_m``: largest cell; ``rim_m``: the first cell at a pad's rim or an electrode's end; ``growth``: ratio of
    one layer to the next, away from the rim; ``spread``: growth of the cells beyond, in metre per metre."""

    cell_m: float
    rim_m: float
    growth: float = 2.5
    spread: float = 0.5


def triangle_areas(point_m: Array, triangle: Indices) -> Array:
    """(E,) signed areas in m²: positive where the corners run counter-clockwise."""
    a, b, c = (point_m[triangle[:, k]] for k in range(3))
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def mesh_sheet(sensor: Sensor, grading: Grading) -> SheetMesh:
    """The sensor's sheet as a conforming mesh; raises ``MeshError`` where pads overlap or leave the sheet."""
    if sensor.electrode_edge_m is not None:
        return _mesh_with_edges(sensor.outline_m, np.asarray(sensor.electrode_edge_m), grading)
    return _mesh_with_pads(sensor.outline_m, sensor.electrode_center_m, sensor.electrode_size_m, grading)


def layers(length_m: float, first_m: float, growth: float) -> Array:
    """Distances (0, first_m, ..., length_m) in steps that grow by a constant ratio, at most about ``growth``."""
    count = int(np.ceil(np.log(1 + length_m / first_m * (growth - 1)) / np.log(growth) - 0.1))
    if count < 2 or first_m >= length_m:
        return np.array([0.0, length_m])
    if count * first_m >= length_m:
        return np.linspace(0.0, length_m, count + 1)
    ratio = brentq(lambda q: first_m * np.sum(q ** np.arange(count)) - length_m, 1.0, 2 * growth)
    offsets = np.concatenate([[0.0], np.cumsum(first_m * ratio ** np.arange(count))])
    return offsets * (length_m / offsets[-1])


def _mesh_with_pads(outline_m: Array, center_m: Array, size_m: Array, grading: Grading) -> SheetMesh:
    half = 0.5 * size_m
    margin = _block_margins(outline_m, center_m, half)
    blocks = []
    for c, h, m in zip(center_m, half, margin, strict=True):
        lines = [_block_lines(c[k], h[k], m, grading) for k in range(2)]
        blocks.append(np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2))
    reach = half + margin[:, None]
    # The outermost layer of a block sets the cell size beside it, and the distance points must keep from it.
    outermost = [np.diff(layers(m, grading.rim_m, grading.growth))[-1] for m in margin]
    bordering_m = np.minimum(grading.cell_m, np.array(outermost))

    def cell(point: Array) -> Array:
        box, away = _distance_to_boxes(point, center_m, reach)
        return np.minimum(grading.cell_m, (bordering_m[box] + grading.spread * away).min(axis=1))

    boundary, _ = _outline_points(outline_m, np.zeros(0), cell)
    inside = _quadtree_points(outline_m, cell, grading.cell_m)
    box, away = _distance_to_boxes(inside, center_m, reach)
    clear = (away > 0.5 * bordering_m[box]).all(axis=1)
    point = np.concatenate([boundary, *blocks, _clear_of(inside[clear], boundary, outline_m, cell)])
    triangle = _delaunay_inside(point, outline_m)
    pad = _covering_pad(point[triangle].mean(axis=1), center_m, half)
    mesh = SheetMesh(point, triangle, pad, tuple(np.zeros((0, 2), dtype=np.intp) for _ in center_m))
    covered = np.bincount(pad + 1, weights=mesh.area_m2, minlength=len(center_m) + 1)[1:]
    if not np.allclose(covered, size_m.prod(axis=1), rtol=1e-9):
        raise MeshError("pads overlap, leave the sheet or lie too close to one another to be meshed")
    _check_area(mesh, outline_m)
    return mesh


def _mesh_with_edges(outline_m: Array, edge_m: Array, grading: Grading) -> SheetMesh:
    start, stop = (_arc_position(outline_m, edge_m[:, k]) for k in range(2))
    ends = edge_m.reshape(-1, 2)
    tree = cKDTree(ends)

    def cell(point: Array) -> Array:
        return np.minimum(grading.cell_m, grading.rim_m + grading.spread * tree.query(point)[0])

    boundary, arc = _outline_points(outline_m, np.concatenate([start, stop]), cell)
    inside = _quadtree_points(outline_m, cell, grading.cell_m)
    point = np.concatenate([boundary, _clear_of(inside, boundary, outline_m, cell)])
    triangle = _delaunay_inside(point, outline_m)
    covered = _covered_edges(arc, start, stop, outline_m)
    if len(np.unique(np.concatenate([edge[:, 0] for edge in covered]))) < sum(map(len, covered)):
        raise MeshError("electrodes overlap on the sheet's edge")
    mesh = SheetMesh(point, triangle, np.full(len(triangle), -1), covered)
    _check_area(mesh, outline_m)
    return mesh


def _block_margins(outline_m: Array, center_m: Array, half_m: Array) -> Array:
    """(L,) how far each pad's block reaches beyond the pad: never into another block, nor near the outline.

    Raises ``MeshError`` where that is less than ``LEAST_MARGIN``.
    """
    margin = half_m.min(axis=1).copy()
    for k, (center, half) in enumerate(zip(center_m, half_m, strict=True)):
        corners = center + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        to_outline = _distance_to_polygon(corners, outline_m).min()
        others = np.arange(len(center_m)) != k
        gap = np.abs(center_m[others] - center).__sub__(half_m[others] + half).max(axis=1, initial=-np.inf)
        margin[k] = min(margin[k], 0.5 * to_outline, 0.3 * gap.min(initial=np.inf))
    if (margin <= LEAST_MARGIN * half_m.min(axis=1)).any():
        raise MeshError(f"pad {int(np.argmin(margin))} overlaps or nearly touches another pad or the outline")
    return margin


def _block_lines(center_m: float, half_m: float, margin_m: float, grading: Grading) -> Array:
    # No longer than twice the margin: a circle about a side of the block then reaches nothing beyond the block's gap.
    inner = _subdivided(layers(half_m, grading.rim_m, grading.growth), 2 * margin_m)
    outer = layers(margin_m, grading.rim_m, grading.growth)
    one_side = np.concatenate([half_m - inner, half_m + outer[1:]])
    return center_m + np.unique(np.concatenate([-one_side, one_side]))


def _subdivided(offset_m: Array, longest_m: float) -> Array:
    """Rising offsets with every interval longer than ``longest_m`` cut into equal parts that are not."""
    parts = np.maximum(np.ceil(np.diff(offset_m) / longest_m - 1e-9).astype(int), 1)
    inside = [np.linspace(a, b, n, endpoint=False) for (a, b), n in zip(pairwise(offset_m), parts, strict=True)]
    return np.append(np.concatenate(inside), offset_m[-1])


def _distance_to_boxes(point: Array, center_m: Array, half_m: Array) -> tuple[Indices, Array]:
    """Which axis-parallel boxes (n,k) have their centres nearest to each point, and how far they are, 0 inside."""
    count = min(NEAR_PADS, len(center_m))
    box = cKDTree(center_m).query(point, count)[1].reshape(len(point), count)
    outside = np.maximum(np.abs(point[:, None] - center_m[box]) - half_m[box], 0.0)
    return box, np.hypot(outside[..., 0], outside[..., 1])


def _covering_pad(point: Array, center_m: Array, half_m: Array) -> Indices:
    """(n,) the pad a point that lies on no rim is in, or -1."""
    box, away = _distance_to_boxes(point, center_m, half_m)
    nearest = away.argmin(axis=1)[:, None]
    inside = np.take_along_axis(away, nearest, axis=1)[:, 0] == 0
    return np.where(inside, np.take_along_axis(box, nearest, axis=1)[:, 0], -1)


def _distance_to_polygon(point: Array, outline_m: Array) -> Array:
    """(n,) distance from the closed polygon's boundary."""
    start, vector, length = sides(outline_m)
    best = np.full(len(point), np.inf)
    for s, v, n in zip(start, vector, length, strict=True):
        along = np.clip((point - s) @ v / n**2, 0.0, 1.0)
        off = point - s - along[:, None] * v
        np.minimum(best, np.hypot(off[:, 0], off[:, 1]), out=best)
    return best


def inside_polygon(point: Array, outline_m: Array) -> NDArray[np.bool_]:
    """(n,) whether points lie inside a closed polygon (even-odd rule)."""
    inside = np.zeros(len(point), dtype=bool)
    x, y = point.T
    for (x0, y0), (x1, y1) in zip(outline_m, np.roll(outline_m, -1, axis=0), strict=True):
        if y0 != y1:
            inside ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return inside


def _arc_position(outline_m: Array, point: Array) -> Array:
    """(n,) arc length of points on the outline from its first corner; raises ``MeshError`` if one isn't on it."""
    arc, distance = arc_position(outline_m, point)
    if (distance > 1e-3 * sides(outline_m)[2].sum() / len(point)).any():
        raise MeshError(f"electrode end {int(distance.argmax())} doesn't lie on the outline")
    return arc


def _outline_points(outline_m: Array, required: Array, cell: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Points on the outline and their arc lengths: all corners, the required arc lengths, and others ``cell`` apart."""
    corner = np.concatenate([[0.0], np.cumsum(sides(outline_m)[2])])
    breaks = np.unique(np.concatenate([corner, required]))
    breaks = breaks[np.concatenate([[True], np.diff(breaks) > 1e-9 * corner[-1]])]
    arcs = []
    for lower, upper in pairwise(breaks):
        most = 50 * (upper - lower) / cell(on_outline(outline_m, lower)).min()
        fine = np.linspace(lower, upper, 2 + int(min(2000, most)))
        density = 1.0 / cell(on_outline(outline_m, fine))
        count = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(fine))])
        pieces = max(1, int(np.ceil(count[-1] - 1e-9)))
        arcs.append(np.interp(np.linspace(0, count[-1], pieces + 1)[:-1], count, fine))
    arc = np.concatenate(arcs)
    return on_outline(outline_m, arc), arc


def _quadtree_points(outline_m: Array, cell: Callable[[Array], Array], largest_m: float) -> Array:
    """Corners of the leaves of a quadtree whose leaves are no larger than ``cell`` at their centres."""
    low, high = outline_m.min(axis=0), outline_m.max(axis=0)
    extent = high - low
    # Whole cells across both sides keep the grid in step with a rectangular outline.
    coarse = np.ceil(extent / largest_m).astype(int)
    size = extent / coarse
    index = np.stack(np.meshgrid(*(np.arange(n) for n in coarse), indexing="ij"), axis=-1).reshape(-1, 2)
    scale, found = 1, []
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    while len(index):
        center = low + (index + 0.5) * size / scale
        split = size.max() / scale > 1.2 * cell(center)
        found.append(((index[~split, None] + corner) / scale).reshape(-1, 2))
        index = (2 * index[split, None] + corner).reshape(-1, 2)
        scale *= 2
    return low + np.unique(np.concatenate(found), axis=0) * size


def _clear_of(point: Array, boundary: Array, outline_m: Array, cell: Callable[[Array], Array]) -> Array:
    """The points inside the outline that keep the outline's edges Delaunay and leave no thin cells beside it."""
    point = point[inside_polygon(point, outline_m)]
    spacing = np.hypot(*(boundary - np.roll(boundary, 1, axis=0)).T)
    near, at = cKDTree(boundary).query(point)
    local = np.maximum(0.55 * cell(point), 0.75 * np.maximum(spacing, np.roll(spacing, -1))[at])
    return point[np.minimum(near, _distance_to_polygon(point, outline_m)) > local * np.where(near < local, 1.0, 0.75)]


def _delaunay_inside(point: Array, outline_m: Array) -> Indices:
    triangle = Delaunay(point).simplices.astype(np.intp)
    area = triangle_areas(point, triangle)
    triangle[area < 0] = triangle[area < 0][:, ::-1]
    side = np.hypot(*(point[triangle] - point[np.roll(triangle, 1, axis=1)]).transpose(2, 0, 1)).max(axis=1)
    solid = np.abs(area) > 1e-9 * side**2
    return triangle[solid & inside_polygon(point[triangle].mean(axis=1), outline_m)]


def _covered_edges(arc: Array, start: Array, stop: Array, outline_m: Array) -> tuple[Indices, ...]:
    """Mesh edges (n,2) of the outline between each electrode's ends; the first points of the mesh are the outline's."""
    around = sides(outline_m)[2].sum()
    following = np.concatenate([arc[1:], [around]])
    middle = 0.5 * (arc + following)
    edge = np.stack([np.arange(len(arc)), np.roll(np.arange(len(arc)), -1)], axis=1)
    return tuple(edge[(middle - a) % around < (b - a) % around] for a, b in zip(start, stop, strict=True))


def _check_area(mesh: SheetMesh, outline_m: Array) -> None:
    x, y = outline_m.T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    if area <= 0:
        raise MeshError("the outline must run counter-clockwise")
    if not np.isclose(mesh.area_m2.sum(), area, rtol=1e-9):
        raise MeshError(f"the mesh covers {mesh.area_m2.sum():.6e} m² of the outline's {area:.6e} m²")
