"""The complete electrode model of a sheet by second-order finite elements, assembled part by part.

-div(s grad u) + y (u - U) = 0 over pads, u + z s du/dn = U along edge electrodes (Cheng et al., IEEE
Trans. Biomed. Eng. 36, 1989; Somersalo, Cheney and Isaacson, SIAM J. Appl. Math. 52, 1992).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix
from scipy.sparse.linalg import splu
from skfem import Basis, ElementTriP2, FacetBasis, MeshTri

from .mesh import Fineness, rims, triangulate
from .outline import Outline

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
ORDER = 4


@dataclass(frozen=True, eq=False)
class Electrodes:
    """Pads inside the sheet (centre and size, both (L,2), metres) or stretches of its outline ``edge_m`` (L,2,2).

    A stretch goes from its first end to its second in the outline's order; ``length_m`` (L,) along it, where not all
    are straight.
    """

    center_m: Array = field(default_factory=lambda: np.zeros((0, 2)))
    size_m: Array = field(default_factory=lambda: np.zeros((0, 2)))
    edge_m: Array | None = None
    length_m: Array | None = None

    def __len__(self) -> int:
        return len(self.center_m) if self.edge_m is None else len(self.edge_m)

    @property
    def extent(self) -> Array:
        """(L,) area in m2 of pads, length in m of edge electrodes."""
        if self.edge_m is None:
            return np.asarray(self.size_m.prod(axis=1))
        if self.length_m is not None:
            return self.length_m
        return np.asarray(np.hypot(*(self.edge_m[:, 1] - self.edge_m[:, 0]).T))


def _solver(matrix: csc_matrix) -> object:
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


class Sheet:
    """A meshed sheet. ``point_m`` (e,q,2) are the places at which conductivity is asked for, ``pad`` (e,) the pad of an
    element or -1."""

    def __init__(self, outline_m: Array, electrodes: Electrodes, fineness: Fineness | None = None) -> None:
        self.electrodes = electrodes
        fineness = fineness or Fineness()
        ends = np.zeros((0, 2)) if electrodes.edge_m is None else electrodes.edge_m.reshape(-1, 2)
        pads = rims(electrodes.center_m, electrodes.size_m)
        points, triangles = triangulate(outline_m, pads, ends, fineness)
        mesh = MeshTri(points.T.copy(), triangles.T.copy())
        basis = Basis(mesh, ElementTriP2(), intorder=ORDER)
        self.dofs: Indices = basis.element_dofs.T.astype(np.intp)
        self.nodes = int(basis.N)
        self.weight = np.asarray(basis.dx)
        self.point_m = np.moveaxis(np.asarray(basis.global_coordinates()), 0, -1)
        self.gradient = np.stack([np.moveaxis(np.asarray(b[0].grad), 0, -1) for b in basis.basis], axis=2)
        shape = np.stack([np.broadcast_to(b[0].value, self.weight.shape) for b in basis.basis], axis=-1)
        self.shape = np.asarray(shape)
        self.pad = self._pads(points[triangles].mean(axis=1), pads)
        self._edges(mesh, outline_m)

    def _pads(self, center: Array, pads: Array) -> Indices:
        owner = np.full(len(center), -1, dtype=np.intp)
        for number, rim in enumerate(pads):
            owner[((center > rim.min(axis=0)) & (center < rim.max(axis=0))).all(axis=1)] = number
        return owner

    def _edges(self, mesh: MeshTri, outline_m: Array) -> None:
        """Facets of edge electrodes: dofs (f,6), owner (f,), shape values and weights at their own points."""
        self.edge_owner = np.zeros(0, dtype=np.intp)
        if self.electrodes.edge_m is None:
            return
        facets = mesh.boundary_facets()
        middle = mesh.p[:, mesh.facets[:, facets]].mean(axis=1).T
        owner = _owners(Outline(outline_m), self.electrodes.edge_m, middle)
        kept = facets[owner >= 0]
        basis = FacetBasis(mesh, ElementTriP2(), facets=kept, intorder=ORDER)
        self.edge_owner = owner[owner >= 0]
        self.edge_dofs = basis.element_dofs.T.astype(np.intp)
        self.edge_weight = np.asarray(basis.dx)
        self.edge_element = mesh.f2t[0, kept]
        self.edge_shape = np.stack([np.broadcast_to(b[0].value, basis.dx.shape) for b in basis.basis], axis=-1)

    def assemble(self, part: Part, conductance: Array, admittance: Array, edge_admittance: Array) -> csc_matrix:
        """Matrix over a part's nodes and electrodes, in the part's own numbering.

        ``conductance`` (e,q) or (e,q,2,2) in siemens, ``admittance`` (e,q) in S/m2 (on pads only), both of the
        part's elements; ``edge_admittance`` (L,) in S/m.
        """
        elements = part.elements
        grad, weight = self.gradient[elements], self.weight[elements]
        if conductance.ndim == 2:
            flow = grad * (conductance * weight)[..., None, None]
        else:
            flow = np.matmul(grad, conductance * weight[..., None, None])
        e = len(elements)
        local = np.matmul(
            flow.transpose(0, 2, 1, 3).reshape(e, 6, -1),
            grad.transpose(0, 2, 1, 3).reshape(e, 6, -1).transpose(0, 2, 1),
        )
        data = [local.ravel()]
        on = part.on_pad
        if len(on):
            data.append(_coupled(self.shape[elements[on]], (admittance * weight)[on]))
        if len(part.facets):
            value = edge_admittance[self.edge_owner[part.facets]][:, None] * self.edge_weight[part.facets]
            data.append(_coupled(self.edge_shape[part.facets], value))
        return coo_matrix((np.concatenate(data), (part.rows, part.columns)), shape=2 * (part.size,)).tocsc()

    def transfer(self, conductance: Array, admittance: Array, edge_admittance: Array) -> Array:
        """(L,L) mean-free transfer matrix in ohm of the whole sheet, solved at once."""
        return transfer_of(self.reduced(conductance, admittance, edge_admittance)[0])

    def reduced(self, conductance: Array, admittance: Array, edge_admittance: Array) -> tuple[Array, Array]:
        """(L,L) conductance matrix of the electrodes, and (n,L) node potentials for one volt at each of them."""
        whole = Part(self, np.arange(len(self.dofs)), np.zeros(0, dtype=np.intp))
        matrix = self.assemble(whole, conductance, admittance, edge_admittance)
        n = self.nodes
        solved = np.asarray(_solver(matrix[:n, :n]).solve(matrix[:n, n:].toarray()))  # type: ignore[attr-defined]
        potential = np.zeros_like(solved)
        potential[whole.inner] = -solved
        return matrix[n:, n:].toarray() - matrix[n:, :n] @ solved, potential

    def owner_of_facets(self) -> Indices:
        """(f,) the element that each facet of an edge electrode belongs to."""
        if not len(self.edge_owner):
            return np.zeros(0, dtype=np.intp)
        return np.asarray(self.edge_element, dtype=np.intp)


def _owners(outline: Outline, edge_m: Array, point_m: Array) -> Indices:
    """(f,) the electrode on whose stretch of the outline each point (f,2) lies, or -1."""
    first, last = outline.way(edge_m.reshape(-1, 2)).reshape(-1, 2).T
    beyond = (outline.way(point_m)[:, None] - first) % outline.length_m
    on = beyond < (last - first) % outline.length_m
    if (on.sum(axis=1) > 1).any():
        raise ValueError("two electrodes on the outline overlap")
    return np.where(on.any(axis=1), on.argmax(axis=1), -1)


def _coupled(shape: Array, value: Array) -> Array:
    """Flat 7x7 matrices of y (u - U)(v - V) with shape functions (e,q,6) and weights y w (e,q)."""
    test = np.concatenate([shape, np.full((*shape.shape[:2], 1), -1.0)], axis=2)
    return np.asarray(np.matmul((test * value[..., None]).transpose(0, 2, 1), test).ravel())


class Part:
    """Some elements of a sheet, numbered inner nodes first, then those on its border, then all electrodes."""

    def __init__(self, sheet: Sheet, elements: Indices, border: Indices) -> None:
        self.elements = elements
        nodes = np.unique(sheet.dofs[elements])
        self.border = np.intersect1d(nodes, border)
        self.inner = np.setdiff1d(nodes, self.border)
        number = np.full(sheet.nodes + len(sheet.electrodes), -1, dtype=np.intp)
        kept = np.concatenate([self.inner, self.border])
        number[kept] = np.arange(len(kept))
        number[sheet.nodes :] = len(kept) + np.arange(len(sheet.electrodes))
        self.size = len(kept) + len(sheet.electrodes)
        self.on_pad = np.flatnonzero(sheet.pad[elements] >= 0)
        self.facets = np.flatnonzero(np.isin(sheet.owner_of_facets(), elements))
        groups = [number[sheet.dofs[elements]]]
        if len(self.on_pad):
            on = elements[self.on_pad]
            groups.append(number[np.column_stack([sheet.dofs[on], sheet.nodes + sheet.pad[on]])])
        if len(self.facets):
            owner = sheet.nodes + sheet.edge_owner[self.facets]
            groups.append(number[np.column_stack([sheet.edge_dofs[self.facets], owner])])
        self.rows = np.concatenate([np.repeat(g, g.shape[1], axis=1).ravel() for g in groups])
        self.columns = np.concatenate([np.tile(g, (1, g.shape[1])).ravel() for g in groups])

    def condensed(self, matrix: csc_matrix) -> Array:
        """Schur complement over border and electrodes."""
        n = len(self.inner)
        coupling = matrix[:n, n:].toarray()
        return np.asarray(matrix[n:, n:].toarray() - coupling.T @ _solver(matrix[:n, :n]).solve(coupling))  # type: ignore[attr-defined]


def transfer_of(conductance: Array) -> Array:
    """(L,L) mean-free transfer matrix of the electrodes' conductance matrix, whose null space is the constants."""
    count = len(conductance)
    symmetric = 0.5 * (conductance + conductance.T)
    mean = np.full((count, count), 1.0 / count)
    scale = np.trace(symmetric) / count
    return np.asarray(np.linalg.inv(symmetric + scale * mean) - mean / scale)
