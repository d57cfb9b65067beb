"""Lagrange triangles of any order: shape functions, quadrature, numbering.

Shape functions are products of a polynomial in each barycentric coordinate: Silvester, Int. J. Eng. Sci. 7 (1969) 849.
Local order of the nodes: three corners, then those along the sides (0,1), (1,2), (2,0), then those inside.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SIDES = np.array([[0, 1], [1, 2], [2, 0]])


@lru_cache
def quadrature(degree: int, order: int | None = None) -> tuple[Array, Array]:
    """Barycentric points (Q,3) and weights (Q,), summing to 1.

    Without ``order``: the centroid for first-order triangles; for others exact two orders beyond the gradients'
    products, because the conductivity varies within an element.
    """
    if degree == 1 and order is None:
        return np.full((1, 3), 1 / 3), np.ones(1)
    point, weight = get_quadrature(RefTri, 2 * degree if order is None else order)
    return np.column_stack([1 - point.sum(axis=0), *point]), weight / weight.sum()


@lru_cache
def lattice(degree: int) -> Indices:
    """(n,3) the nodes' barycentric coordinates times the degree, in local order."""
    corners = degree * np.eye(3, dtype=np.intp)
    sides = [((degree - k) * corners[a] + k * corners[b]) // degree for a, b in SIDES for k in range(1, degree)]
    inside = [(degree - i - j, i, j) for i, j in product(range(1, degree), repeat=2) if i + j < degree]
    return np.array([*corners, *sides, *inside], dtype=np.intp)


def _factors(degree: int, coordinate: Array) -> tuple[Array, Array]:
    """Values and derivatives (degree+1, ...) of the polynomials binomial(degree * x, n) in one coordinate."""
    value, slope = [np.ones_like(coordinate)], [np.zeros_like(coordinate)]
    for n in range(1, degree + 1):
        step = (degree * coordinate - (n - 1)) / n
        slope.append(slope[-1] * step + value[-1] * degree / n)
        value.append(value[-1] * step)
    return np.array(value), np.array(slope)


def shape_functions(degree: int, barycentric: Array) -> Array:
    """(Q,n) values of the n shape functions at barycentric points (Q,3)."""
    value, _ = _factors(degree, barycentric)
    return np.prod([value[lattice(degree)[:, k], :, k] for k in range(3)], axis=0).T


def shape_slopes(degree: int, barycentric: Array) -> Array:
    """(Q,n,3) derivatives of the shape functions by each barycentric coordinate."""
    value, slope = _factors(degree, barycentric)
    each = [value[lattice(degree)[:, k], :, k] for k in range(3)]
    by = [slope[lattice(degree)[:, k], :, k] for k in range(3)]
    return np.stack([by[k] * each[(k + 1) % 3] * each[(k + 2) % 3] for k in range(3)], axis=-1).swapaxes(0, 1)


def edge_mass(degree: int) -> Array:
    """(degree+1, degree+1) products of shape functions averaged over a side: its two ends, then the nodes between."""
    point, weight = np.polynomial.legendre.leggauss(degree + 1)
    x = 0.5 * (point + 1)
    first, second = _factors(degree, 1 - x)[0], _factors(degree, x)[0]
    order = np.array([0, degree, *range(1, degree)])
    shape = first[degree - order] * second[order]
    return (shape * (0.5 * weight)) @ shape.T


def triangle_mass(degree: int) -> Array:
    """(n,n) products of shape functions averaged over a triangle."""
    barycentric, weight = quadrature(degree, 2 * degree)
    shape = shape_functions(degree, barycentric)
    return shape.T @ (weight[:, None] * shape)


@dataclass(frozen=True, eq=False)
class Space:
    """Continuous piecewise polynomials on a triangle mesh.

    ``node_m`` (N,2), the mesh's points first; ``element`` (E,n) nodes of each triangle; ``slope`` (E,3,2) gradients of
    the barycentric coordinates in 1/m; ``area_m2`` (E,).
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
        element = _numbered(triangle, degree)
        node_m = np.empty((element.max() + 1, 2))
        node_m[element] = np.einsum("nb,ebd->end", lattice(degree) / degree, corner)
        return cls(degree, node_m, element, slope, 0.5 * twice_area)

    @property
    def nodes(self) -> int:
        """Number of nodes N."""
        return len(self.node_m)

    def gradients(self) -> Array:
        """(E,Q,2,n) gradients of the shape functions at the quadrature points, in 1/m."""
        slopes = shape_slopes(self.degree, quadrature(self.degree)[0])
        return np.einsum("qnb,ebd->eqdn", slopes, self.slope, optimize=True)

    def quadrature_m(self) -> Array:
        """(E,Q,2) quadrature points."""
        return np.einsum("qb,ebd->eqd", quadrature(self.degree)[0], self.node_m[self.element[:, :3]])

    def weights_m2(self) -> Array:
        """(E,Q) quadrature weights: sum over Q gives the element's area."""
        return self.area_m2[:, None] * quadrature(self.degree)[1]

    def edge_nodes(self, edge: Indices) -> Indices:
        """(n, degree+1) nodes of mesh edges (n,2): the ends, then those between from the first to the second end.

        Raises ``KeyError`` where a pair of points is no edge of the mesh.
        """
        code, first, between = self._sides
        wanted = _side_codes(edge)
        at = np.minimum(np.searchsorted(code, wanted), len(code) - 1)
        if not np.array_equal(code[at], wanted):
            raise KeyError("a pair of points is no edge of the mesh")
        part = np.where((first[at] == edge[:, 0])[:, None], between[at], between[at][:, ::-1])
        return np.concatenate([edge, part], axis=1)

    @cached_property
    def _sides(self) -> tuple[Indices, Indices, Indices]:
        """Codes (S,) of the mesh's edges, ascending, the point (S,) that each begins with and the nodes between."""
        between = self.degree - 1
        ends = self.element[:, SIDES].reshape(-1, 2)
        nodes = self.element[:, 3 : 3 + 3 * between].reshape(len(ends), between)
        code, one = np.unique(_side_codes(ends), return_index=True)
        return code, ends[one, 0], nodes[one]


def _side_codes(ends: Indices) -> Indices:
    """(n,) a number for each pair of points (n,2), whichever comes first."""
    return np.asarray((ends.max(axis=1).astype(np.int64) << 32) + ends.min(axis=1))


def _numbered(triangle: Indices, degree: int) -> Indices:
    """(E,n) node numbers: the corners', then along each side from its lower-numbered end, then inside."""
    points, between = int(triangle.max()) + 1, degree - 1
    end = triangle[:, SIDES]
    unique, number = np.unique(np.sort(end, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    step = np.arange(between)
    along = np.where((end[..., 0] < end[..., 1])[..., None], step, step[::-1])
    side = points + number.reshape(-1, 3)[..., None] * between + along
    inner = len(lattice(degree)) - 3 * degree
    first_inner = points + len(unique) * between
    inside = first_inner + np.arange(len(triangle) * inner).reshape(len(triangle), inner)
    return np.concatenate([triangle, side.reshape(len(triangle), -1), inside], axis=1)
