"""Conduction in the sheet with the complete electrode model (paper II-D, eqs. 1-3).

Weak form (Somersalo, Cheney, Isaacson, SIAM J. Appl. Math. 52 (1992) 1023): for potentials u in the sheet and U_l on
the electrodes,

    int sigma grad u . grad v + sum_l 1/z_l int_l (u - U_l)(v - V_l) = sum_l I_l V_l,

where l runs over a pad's area or an edge electrode's length and z_l = R_l |l| is its specific contact impedance. The
sheet's unknowns are eliminated for unit potential on each electrode in turn: one factorisation and L right-hand
sides give the (L,L) conductance between the electrodes, whose inverse on mean-free currents is the transfer matrix.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from physics.conduction.factor import SymmetricPattern
from physics.conduction.mesh import Grading, SheetMesh, mesh_sheet
from physics.conduction.triangle import Space, quadrature, shape_functions
from physics.protocol import pair_resistances
from physics.sensor import Sensor

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

CHUNK_POINTS = 16384  # quadrature points whose field products are held at once
EDGE_MASS = {
    1: np.array([[2, 1], [1, 2]]) / 6,
    2: np.array([[4, -1, 2], [-1, 4, 2], [2, 2, 16]]) / 30,  # ends, middle
}


@dataclass(frozen=True)
class Resolution:
    """Order of the triangles and grading of the mesh."""

    degree: int
    grading: Grading


RESOLUTIONS = {
    "fast": Resolution(2, Grading(cell_m=5e-3, rim_m=4e-4, growth=3.0)),
    "fine": Resolution(2, Grading(cell_m=2.5e-3, rim_m=1e-4, growth=2.5)),
    "reference": Resolution(2, Grading(cell_m=1.25e-3, rim_m=4e-5, growth=2.0)),
}


class SheetModel:
    """Forward model of one sheet on one mesh: conductivity and contact resistances in, pair resistances out.

    ``quadrature_m`` (E,Q,2): where the conductivity is asked for. ``weight_m2`` (E,Q). ``electrode_size`` (L,): area
    in m² of a pad, length in m of an edge electrode; its product with the contact resistance is the specific impedance.
    """

    def __init__(self, sensor: Sensor, resolution: str | Resolution = "fine") -> None:
        """Raises ``MeshError`` if the sensor can't be meshed, ``KeyError`` for an unknown name of a resolution."""
        chosen = RESOLUTIONS[resolution] if isinstance(resolution, str) else resolution
        self._prepare(mesh_sheet(sensor, chosen.grading), chosen.degree)

    @classmethod
    def from_mesh(cls, mesh: SheetMesh, degree: int = 1) -> SheetModel:
        """The model on a mesh made elsewhere."""
        model = cls.__new__(cls)
        model._prepare(mesh, degree)
        return model

    def _prepare(self, mesh: SheetMesh, degree: int) -> None:
        self.mesh = mesh
        self.space = Space.on(mesh.point_m, mesh.triangle, degree)
        self.quadrature_m = self.space.quadrature_m()
        self.weight_m2 = self.space.weights_m2()
        self._contacts = [_contact_block(mesh, self.space, k) for k in range(mesh.electrodes)]
        self.electrode_size = np.array([size for _, _, size in self._contacts])
        if (self.electrode_size <= 0).any():
            raise ValueError(f"electrode {int(self.electrode_size.argmin())} touches no element of the mesh")
        self._touch = _columns([(nodes, mass.sum(axis=1)) for nodes, mass, _ in self._contacts], self.space.nodes)
        self._number_entries()
        self.pattern = SymmetricPattern(self._row, self._column, self.space.nodes)

    def _number_entries(self) -> None:
        """Entries of the lower triangle, and where each element's and each electrode's local matrix adds to them."""
        a, b = np.tril_indices(self.space.element.shape[1])
        codes = [_code(self.space.element[:, a], self.space.element[:, b], self.space.nodes).ravel()]
        for nodes, _, _ in self._contacts:
            k, m = np.tril_indices(len(nodes))
            codes.append(_code(nodes[k], nodes[m], self.space.nodes))
        unique, entry = np.unique(np.concatenate(codes), return_inverse=True)
        self._row, self._column = np.divmod(unique, self.space.nodes)
        cuts = np.cumsum([len(code) for code in codes])[:-1]
        element, *contact = np.split(entry, cuts)
        self._element_entry = element.reshape(len(self.space.element), -1)
        values = [mass[np.tril_indices(len(nodes))] for nodes, mass, _ in self._contacts]
        self._contact_map = _columns(list(zip(contact, values, strict=True)), len(unique))

    @cached_property
    def _conductivity_map(self) -> csr_array:
        """(entries, E*Q) the linear map from a scalar conductivity to the matrix entries."""
        return (self._tensor_maps[0] + self._tensor_maps[2]).tocsr()

    @cached_property
    def _tensor_maps(self) -> tuple[csr_array, csr_array, csr_array]:
        """The maps from sigma_xx, sigma_xy and sigma_yy to the matrix entries."""
        a, b = np.tril_indices(self.space.element.shape[1])
        gradient = self.space.gradients()
        x, y = gradient[:, :, 0], gradient[:, :, 1]
        weight = self.weight_m2[..., None]
        local = (x[..., a] * x[..., b], x[..., a] * y[..., b] + y[..., a] * x[..., b], y[..., a] * y[..., b])
        point = np.arange(self.weight_m2.size).reshape(*self.weight_m2.shape, 1)
        row = np.broadcast_to(self._element_entry[:, None], local[0].shape).ravel()
        column = np.broadcast_to(point, local[0].shape).ravel()
        shape = (len(self._row), self.weight_m2.size)
        xx, xy, yy = (csr_array(coo_array(((weight * k).ravel(), (row, column)), shape=shape)) for k in local)
        return xx, xy, yy

    @property
    def electrodes(self) -> int:
        """Number of electrodes L."""
        return self.mesh.electrodes

    def uniform(self, sheet_resistance_ohm_sq: float) -> Array:
        """(E,Q) conductivity of a uniform sheet, in siemens."""
        return np.full(self.weight_m2.shape, 1.0 / sheet_resistance_ohm_sq)

    def stiffness(self, conductivity_s: Array) -> Array:
        """Matrix entries of int sigma grad u . grad v for a conductivity (E,Q) or a tensor (E,Q,3)."""
        if conductivity_s.shape == self.weight_m2.shape:
            return self._conductivity_map @ conductivity_s.ravel()
        if conductivity_s.shape != (*self.weight_m2.shape, 3):
            expected = f"{self.weight_m2.shape} or {(*self.weight_m2.shape, 3)}"
            raise ValueError(f"conductivity has shape {conductivity_s.shape}; expected {expected}")
        parts = np.moveaxis(conductivity_s, -1, 0).reshape(3, -1)
        return sum(m @ part for m, part in zip(self._tensor_maps, parts, strict=True))  # type: ignore[return-value]

    def solve(self, conductivity_s: Array, contact_resistance_ohm: Array) -> Solution:
        """One conductivity (E,Q) in siemens (or (E,Q,3): xx, xy, yy) and contact resistances (L,) in ohm.

        Raises ``ValueError`` for wrong shapes or resistances that aren't positive, ``LinAlgError`` where the
        conductivity isn't positive.
        """
        resistance = np.broadcast_to(np.asarray(contact_resistance_ohm, dtype=float), (self.electrodes,))
        if not (resistance > 0).all():
            raise ValueError("contact resistances must be positive")
        per_size = 1.0 / (resistance * self.electrode_size)
        factor = self.pattern.factor(self.stiffness(conductivity_s) + self._contact_map @ per_size)
        coupling = (self._touch * per_size).toarray()
        potential = factor.solve(coupling)
        conductance = np.diag(1.0 / resistance) - coupling.T @ potential
        return Solution(self, np.asarray(conductivity_s), resistance, potential, _transfer(conductance))

    def contact_losses(self, potential: Array) -> Array:
        """(L,k,k) int_l (u_i - U_i)(u_j - U_j) over each electrode, for unit potentials on one electrode at a time.

        ``potential`` (N,L): the fields of unit potential on each electrode, as ``Solution.potential``.
        """
        losses = np.empty((self.electrodes, self.electrodes, self.electrodes))
        for k, (nodes, mass, _) in enumerate(self._contacts):
            drop = potential[nodes].copy()
            drop[:, k] -= 1.0
            losses[k] = drop.T @ mass @ drop
        return losses


@dataclass(frozen=True, eq=False)
class Solution:
    """Fields and transfer matrix of one conductivity; derivatives by the adjoint, dT_ij = -int ds grad u_i . grad u_j.

    ``potential`` (N,L): potential in the sheet for one volt on one electrode and none on the others, dimensionless;
    ``transfer_ohm`` (L,L): mean-free potentials of the electrodes per ampere into each.
    """

    model: SheetModel
    conductivity_s: Array
    contact_resistance_ohm: Array
    potential: Array
    transfer_ohm: Array

    @cached_property
    def pair_resistance_ohm(self) -> Array:
        """(P,) pair resistances, P = L(L-1)/2."""
        return pair_resistances(self.transfer_ohm)

    def fields(self, elements: Indices | slice = slice(None)) -> Array:
        """(E,Q,2,L) gradients in 1/m of ``potential`` at the quadrature points."""
        space = self.model.space
        return np.matmul(space.gradients(elements), self.potential[space.element[elements]][:, None])

    def directional(self, conductivity_change_s: Array) -> Array:
        """(..., P) change in ohm of the pair resistances to first order for changes (..., E, Q) of the conductivity.

        Only the elements where some change isn't zero are visited.
        """
        change = np.asarray(conductivity_change_s, dtype=float)
        return self._contract(change[..., None], _scalar_products)

    def directional_tensor(self, conductivity_change_s: Array) -> Array:
        """(..., P) the same for changes (..., E, Q, 3) of a conductivity tensor: xx, xy, yy."""
        return self._contract(np.asarray(conductivity_change_s, dtype=float), _tensor_products)

    def _contract(self, change: Array, products: Callable[[Array], Array]) -> Array:
        """Changes (..., E, Q, C) against the C products of fields, chunk by chunk over the elements touched."""
        weight = self.model.weight_m2
        flat = change.reshape(-1, *weight.shape, change.shape[-1])
        touched = np.flatnonzero(flat.any(axis=(0, 2, 3)))
        total = np.zeros((len(flat), self.model.electrodes * (self.model.electrodes + 1) // 2))
        step = max(1, CHUNK_POINTS // weight.shape[1])
        for first in range(0, len(touched), step):
            elements = touched[first : first + step]
            product = products(self.fields(elements))
            weighted = flat[:, elements] * weight[elements, :, None]
            total += weighted.reshape(len(flat), -1) @ product.reshape(-1, total.shape[1])
        return self._pairs_of(total).reshape(*change.shape[:-3], -1)

    def _pairs_of(self, lower: Array) -> Array:
        """(F,P) change of the pair resistances for the lower triangles (F, L(L+1)/2) of d(conductance)."""
        count = self.model.electrodes
        i, j = np.tril_indices(count)
        full = np.zeros((len(lower), count, count))
        full[:, i, j] = lower
        full[:, j, i] = lower
        return -pair_resistances(self.transfer_ohm @ full @ self.transfer_ohm)

    def jacobian_conductivity(self) -> Array:
        """(P,E,Q) derivative of the pair resistances by the conductivity at each quadrature point, in ohm/siemens."""
        elements = self.model.weight_m2.shape[0]
        i, j = np.triu_indices(self.model.electrodes, 1)
        jacobian = np.empty((len(i), *self.model.weight_m2.shape))
        step = max(1, CHUNK_POINTS // self.model.weight_m2.shape[1])
        for first in range(0, elements, step):
            part = slice(first, min(first + step, elements))
            field = self.fields(part) @ self.transfer_ohm
            loss = ((field[..., i] - field[..., j]) ** 2).sum(axis=2)
            jacobian[:, part] = np.moveaxis(loss * -self.model.weight_m2[part, :, None], -1, 0)
        return jacobian

    def jacobian_contact_resistance(self) -> Array:
        """(P,L) derivative of each pair resistance by each contact resistance, dimensionless."""
        losses = self.model.contact_losses(self.potential)
        per_ohm = losses / (self.contact_resistance_ohm**2 * self.model.electrode_size)[:, None, None]
        return pair_resistances(self.transfer_ohm @ per_ohm @ self.transfer_ohm).T


def _scalar_products(field: Array) -> Array:
    """(E,Q,1,L(L+1)/2) lower triangle of grad u_i . grad u_j for fields (E,Q,2,L)."""
    i, j = np.tril_indices(field.shape[-1])
    return (field[..., i] * field[..., j]).sum(axis=2, keepdims=True)


def _tensor_products(field: Array) -> Array:
    """(E,Q,3,L(L+1)/2) what multiplies sigma_xx, sigma_xy and sigma_yy."""
    i, j = np.tril_indices(field.shape[-1])
    x, y = field[:, :, 0], field[:, :, 1]
    mixed = x[..., i] * y[..., j] + y[..., i] * x[..., j]
    return np.stack([x[..., i] * x[..., j], mixed, y[..., i] * y[..., j]], axis=2)


def _transfer(conductance: Array) -> Array:
    """Inverse of the (L,L) conductance between electrodes on mean-free currents."""
    count = len(conductance)
    conductance = 0.5 * (conductance + conductance.T)
    constant = np.full((count, count), np.trace(conductance) / count**2)
    transfer = np.linalg.inv(conductance + constant)
    transfer -= transfer.mean(axis=0)
    transfer -= transfer.mean(axis=1, keepdims=True)
    return 0.5 * (transfer + transfer.T)


def _code(a: Indices, b: Indices, nodes: int) -> Indices:
    return np.maximum(a, b) * nodes + np.minimum(a, b)


def _columns(column: list[tuple[Indices, Array]], rows: int) -> csr_array:
    """(rows, L) sparse matrix with the given entries in each column; entries of the same row add up."""
    row = np.concatenate([indices for indices, _ in column])
    value = np.concatenate([values for _, values in column])
    number = np.repeat(np.arange(len(column)), [len(indices) for indices, _ in column])
    return csr_array(coo_array((value, (row, number)), shape=(rows, len(column))))


def _contact_block(mesh: SheetMesh, space: Space, electrode: int) -> tuple[Indices, Array, float]:
    """Nodes (k,) under an electrode, their mass matrix (k,k) over its area or length, and that area or length."""
    elements = np.flatnonzero(mesh.pad == electrode)
    if len(elements):
        barycentric, weight = _mass_rule(space.degree)
        shape = shape_functions(space.degree, barycentric)
        reference = shape.T @ (weight[:, None] * shape)
        size, cells = space.area_m2[elements], space.element[elements]
    else:
        edge = mesh.edge[electrode]
        cells = edge if space.degree == 1 else np.column_stack([edge, space.middle_nodes(edge)])
        reference = EDGE_MASS[space.degree]
        size = np.hypot(*(mesh.point_m[edge[:, 1]] - mesh.point_m[edge[:, 0]]).T)
    nodes, local = np.unique(cells, return_inverse=True)
    local = local.reshape(cells.shape)
    mass = np.zeros((len(nodes), len(nodes)))
    np.add.at(mass, (local[:, :, None], local[:, None, :]), size[:, None, None] * reference)
    return nodes, mass, float(size.sum())


def _mass_rule(degree: int) -> tuple[Array, Array]:
    """A rule exact for products of shape functions: twice the triangles' degree."""
    return quadrature(2) if degree == 2 else (np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6, np.full(3, 1 / 3))
