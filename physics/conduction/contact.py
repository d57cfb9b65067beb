"""Where an electrode touches the sheet: a pad's triangles, or an edge electrode's stretch of the outline."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ertskin.physics.conduction.mesh import SheetMesh
from ertskin.physics.conduction.triangle import Space, edge_mass, triangle_mass

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


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
            extent, cell, reference = space.area_m2[elements], space.element[elements], triangle_mass(space.degree)
        else:
            edge = mesh.edge[electrode]
            extent = np.hypot(*(mesh.point_m[edge[:, 1]] - mesh.point_m[edge[:, 0]]).T)
            cell = space.edge_nodes(edge)
            reference = edge_mass(space.degree)
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

    @cached_property
    def sparse_mass(self) -> csr_array:
        """``mass`` without its zeros."""
        return csr_array(self.mass)
