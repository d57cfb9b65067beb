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

SHOWN = 1e-6
"""Least part of a form that cells must show beyond the forms before it."""


@dataclass(frozen=True, eq=False)
class Contact:
    """``cell`` (c,n) nodes of the triangles or edges touched; ``cell_mass`` (c,n,n) integrals over each of the products
    of its shape functions; ``cell_size`` (c,) area in m² or length in m of each and ``center_m`` (c,2) its middle;
    ``is_pad``: triangles."""

    cell: Indices
    cell_mass: Array
    cell_size: Array
    center_m: Array
    is_pad: bool

    @classmethod
    def of(cls, mesh: SheetMesh, space: Space, electrode: int) -> Contact:
        """The contact of one electrode; raises ``ValueError`` if it touches nothing."""
        elements = np.flatnonzero(mesh.pad == electrode)
        if len(elements):
            extent, cell, reference = space.area_m2[elements], space.element[elements], triangle_mass(space.degree)
            corners_m = mesh.point_m[mesh.triangle[elements]]
        else:
            edge = mesh.edge[electrode]
            corners_m = mesh.point_m[edge]
            extent = np.hypot(*(corners_m[:, 1] - corners_m[:, 0]).T)
            cell = space.edge_nodes(edge)
            reference = edge_mass(space.degree)
        if not extent.sum() > 0:
            raise ValueError(f"electrode {electrode} touches nothing of the mesh")
        return cls(cell, extent[:, None, None] * reference, extent, corners_m.mean(axis=1), len(elements) > 0)

    @property
    def size(self) -> float:
        """Area in m² of a pad, length in m of an edge electrode."""
        return float(self.cell_size.sum())

    @property
    def form_count(self) -> int:
        """J, the number of ``forms``."""
        return 5 if self.is_pad else 2

    @cached_property
    def forms(self) -> Array:
        """(c,J) forms in which a contact may lean, what its cells conduct per area more than its mean: polynomials of
        second degree, mean nought and mean square one, J = 5 of a pad and 2 along an edge electrode; noughts for those
        that so few cells can't show.

        Next to an indenter one side of a pad may conduct five times as well as the other: there they leave a few
        hundredths of a 2 mV noise, and the mean alone four times the noise.
        """
        found, width_m = np.zeros((len(self.cell), self.form_count)), np.ptp(self.center_m, axis=0).max()
        if not width_m > 0:
            return found
        apart = (self.center_m - self.center_m.mean(axis=0)) / width_m
        if self.is_pad:
            x, y = apart.T
            monomials = np.stack([np.ones(len(x)), x, y, x**2, x * y, y**2], axis=1)
        else:
            along = np.linalg.svd(apart, full_matrices=False)[2][0]
            x = apart @ (along * np.sign(along[np.abs(along).argmax()]))
            monomials = np.stack([np.ones(len(x)), x, x**2], axis=1)
        weight = np.sqrt(self.cell_size / self.size)
        basis, triangle = np.linalg.qr(weight[:, None] * monomials)
        size = np.diag(triangle)[1:]
        shown = np.flatnonzero(np.abs(size) > SHOWN)
        found[:, shown] = basis[:, 1 + shown] * np.sign(size[shown]) / weight[:, None]
        return found

    def lean(self, share: Array) -> Array:
        """(...,J) how a contact leans whose cells conduct by ``share`` (...,c) of its mean, in its ``forms``."""
        return np.asarray((share * (self.cell_size / self.size)) @ self.forms)

    def weighted_mass(self, share: Array) -> csr_array:
        """``sparse_mass`` of a contact whose cells conduct by ``share`` (c,) of its mean."""
        return csr_array(self._summed(self.cell_mass * share[:, None, None]))

    @cached_property
    def form_masses(self) -> list[csr_array]:
        """``sparse_mass`` weighted by each of the ``forms``."""
        return [csr_array(self._summed(self.cell_mass * form[:, None, None])) for form in self.forms.T]

    @cached_property
    def nodes(self) -> Indices:
        """(k,) nodes touched."""
        return np.unique(self.cell)

    @cached_property
    def mass(self) -> Array:
        """(k,k) integrals over the whole contact of the products of the shape functions of ``nodes``."""
        return self._summed(self.cell_mass)

    @cached_property
    def sparse_mass(self) -> csr_array:
        """``mass`` without its zeros."""
        return csr_array(self.mass)

    def _summed(self, cell_mass: Array) -> Array:
        """(k,k) cells' integrals (c,n,n), added up over the contact."""
        local = np.searchsorted(self.nodes, self.cell)
        mass = np.zeros((len(self.nodes), len(self.nodes)))
        np.add.at(mass, (local[:, :, None], local[:, None, :]), cell_mass)
        return mass
