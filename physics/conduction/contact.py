"""Where an electrode touches the sheet: a pad's triangles, or an edge electrode's stretch of the outline."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from physics.conduction.mesh import SheetMesh
from physics.conduction.triangle import Space, quadrature, shape_functions

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

EDGE_MASS = {
    1: np.array([[2, 1], [1, 2]]) / 6,
    2: np.array([[4, -1, 2], [-1, 4, 2], [2, 2, 16]]) / 30,  # ends, middle
}
CENTROID_AND_SIDES = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6


@dataclass(frozen=True, eq=False)
class Contact:
    """``cell`` (c,n) nodes of the triangles or edges touched; ``cell_mass`` (c,n,n) integrals over each of the products
    of its shape functions; ``size``: area in m² of a pad, length in m of an edge electrode."""

    cell: Indices
    cell_mass: Array
    size: float

    @classmethod
    def of(cls, mesh: SheetMesh, space: Space, electrode: int) -> Contact:
        """The contact of one electrode; raises ``ValueError`` if it touches nothing."""
        elements = np.flatnonzero(mesh.pad == electrode)
        if len(elements):
            extent, cell, reference = space.area_m2[elements], space.element[elements], _triangle_mass(space.degree)
        else:
            edge = mesh.edge[electrode]
            extent = np.hypot(*(mesh.point_m[edge[:, 1]] - mesh.point_m[edge[:, 0]]).T)
            cell = edge if space.degree == 1 else np.column_stack([edge, space.middle_nodes(edge)])
            reference = EDGE_MASS[space.degree]
        if not extent.sum() > 0:
            raise ValueError(f"electrode {electrode} touches nothing of the mesh")
        return cls(cell, extent[:, None, None] * reference, float(extent.sum()))

    @cached_property
    def nodes(self) -> Indices:
        """(k,) nodes touched."""
        return np.unique(self.cell)

    @cached_property
    def mass(self) -> Array:
        """(k,k) integrals over the whole contact of the products of the shape functions of ``nodes``."""
        local = np.searchsorted(self.nodes, self.cell)
        mass = np.zeros((len(self.nodes), len(self.nodes)))
        np.add.at(mass, (local[:, :, None], local[:, None, :]), self.cell_mass)
        return mass


def _triangle_mass(degree: int) -> Array:
    """Products of shape functions averaged over a triangle, by a rule of twice their degree."""
    barycentric, weight = quadrature(2) if degree == 2 else (CENTROID_AND_SIDES, np.full(3, 1 / 3))
    shape = shape_functions(degree, barycentric)
    return shape.T @ (weight[:, None] * shape)
