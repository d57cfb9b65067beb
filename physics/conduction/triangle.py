"""Lagrange triangles of first and second order: shape functions, quadrature, numbering.

Local order of the second-order nodes: three corners, then the middles of the sides (0,1), (1,2), (2,0).
Quadrature: Dunavant, Int. J. Numer. Methods Eng. 21 (1985) 1129.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SIDES = np.array([[0, 1], [1, 2], [2, 0]])


def quadrature(degree: int) -> tuple[Array, Array]:
    """Barycentric points (Q,3) and weights (Q,), summing to 1, exact for the gradients' products of P1 or P2.

    P1: the centroid. P2: six points of degree 4, two degrees more than constant conductivity needs, because the
    conductivity varies within an element.
    """
    if degree == 1:
        return np.full((1, 3), 1 / 3), np.ones(1)
    if degree == 2:
        groups = ((0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322))
        points = [np.roll([1 - 2 * a, a, a], k) for a, _ in groups for k in range(3)]
        return np.array(points), np.repeat([w for _, w in groups], 3)
    raise ValueError(f"triangles of degree 1 or 2, not {degree}")


def shape_functions(degree: int, barycentric: Array) -> Array:
    """(Q,n) values of the n shape functions at barycentric points (Q,3)."""
    if degree == 1:
        return barycentric
    a, b = barycentric[:, SIDES[:, 0]], barycentric[:, SIDES[:, 1]]
    return np.concatenate([barycentric * (2 * barycentric - 1), 4 * a * b], axis=1)


def shape_slopes(degree: int, barycentric: Array) -> Array:
    """(Q,n,3) derivatives of the shape functions by each barycentric coordinate."""
    unit = np.eye(3)
    if degree == 1:
        return np.broadcast_to(unit, (len(barycentric), 3, 3))
    corner = (4 * barycentric - 1)[:, :, None] * unit
    a, b = barycentric[:, SIDES[:, 0]], barycentric[:, SIDES[:, 1]]
    side = 4 * (a[:, :, None] * unit[SIDES[:, 1]] + b[:, :, None] * unit[SIDES[:, 0]])
    return np.concatenate([corner, side], axis=1)


@dataclass(frozen=True, eq=False)
class Space:
    """Continuous piecewise polynomials on a triangle mesh.

    ``degree`` 1 or 2; ``node_m`` (N,2), the mesh's points first; ``element`` (E,n) nodes of each triangle;
    ``slope`` (E,3,2) gradients of the barycentric coordinates in 1/m; ``area_m2`` (E,).
    """

    degree: int
    node_m: Array
    element: Indices
    slope: Array
    area_m2: Array

    @classmethod
    def on(cls, point_m: Array, triangle: Indices, degree: int) -> Space:
        """The space of ``degree`` on triangles (E,3), corners counter-clockwise."""
        corner = point_m[triangle]
        opposite = np.roll(corner, 1, axis=1) - np.roll(corner, -1, axis=1)
        twice_area = opposite[:, 0, 0] * opposite[:, 1, 1] - opposite[:, 0, 1] * opposite[:, 1, 0]
        slope = np.stack([-opposite[..., 1], opposite[..., 0]], axis=-1) / twice_area[:, None, None]
        if degree == 1:
            return cls(1, point_m, triangle, slope, 0.5 * twice_area)
        side = np.sort(triangle[:, SIDES].reshape(-1, 2), axis=1)
        unique, number = np.unique(side, axis=0, return_inverse=True)
        node_m = np.concatenate([point_m, point_m[unique].mean(axis=1)])
        element = np.concatenate([triangle, len(point_m) + number.reshape(-1, 3)], axis=1)
        return cls(2, node_m, element, slope, 0.5 * twice_area)

    @property
    def nodes(self) -> int:
        """Number of nodes N."""
        return len(self.node_m)

    def gradients(self, elements: Indices | slice = slice(None)) -> Array:
        """(E,Q,2,n) gradients of the shape functions at the quadrature points, in 1/m."""
        slopes = shape_slopes(self.degree, quadrature(self.degree)[0])
        return np.einsum("qnb,ebd->eqdn", slopes, self.slope[elements], optimize=True)

    def quadrature_m(self) -> Array:
        """(E,Q,2) quadrature points."""
        return np.einsum("qb,ebd->eqd", quadrature(self.degree)[0], self.node_m[self.element[:, :3]])

    def weights_m2(self) -> Array:
        """(E,Q) quadrature weights: sum over Q gives the element's area."""
        return self.area_m2[:, None] * quadrature(self.degree)[1]

    def middle_nodes(self, edge: Indices) -> Indices:
        """(n,) nodes in the middle of mesh edges (n,2); second order only. ``KeyError`` where it is no edge."""
        side = np.sort(self.element[:, SIDES].reshape(-1, 2), axis=1)
        middle = {(int(a), int(b)): int(m) for (a, b), m in zip(side, self.element[:, 3:].ravel(), strict=True)}
        return np.array([middle[int(min(a, b)), int(max(a, b))] for a, b in edge], dtype=np.intp)
