"""Conduction in the sheet with the complete electrode model (paper II-D, eqs. 1-3).

Weak form (Somersalo, Cheney, Isaacson, SIAM J. Appl. Math. 52 (1992) 1023): for potentials u in the sheet and U_l on
the electrodes,

    int sigma grad u . grad v + sum_l 1/z_l int_l (u - U_l)(v - V_l) = sum_l I_l V_l,

where l runs over a pad's area or an edge electrode's length and z_l = R_l |l| is its specific contact impedance, which
may vary over it: a contact's share says what 1/z_l is in each of its cells, over its mean. The
sheet's unknowns are eliminated; what remains is the (L,L) conductance between the electrodes, whose inverse on
mean-free currents is the transfer matrix.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from ertskin.physics.conduction.assembly import ElementMatrices
from ertskin.physics.conduction.contact import Contact
from ertskin.physics.conduction.dissection import dissect
from ertskin.physics.conduction.field_products import field_products, pair_losses
from ertskin.physics.conduction.mesh import Grading, SheetMesh, mesh_sheet
from ertskin.physics.conduction.multifrontal import FrontalFactor, Fronts
from ertskin.physics.conduction.triangle import Space
from ertskin.physics.protocol import pair_resistances
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

CHUNK_POINTS = 16384  # quadrature points whose field products are held at once


@dataclass(frozen=True)
class Resolution:
    """Order of the triangles and grading of the mesh."""

    degree: int
    grading: Grading


RESOLUTIONS = {
    "fast": Resolution(2, Grading(cell_m=4e-3, rim_m=2e-4, growth=7.0, spread=0.7)),
    "fine": Resolution(3, Grading(cell_m=4e-3, rim_m=2e-4, growth=7.0, spread=0.7)),
    "reference": Resolution(4, Grading(cell_m=4e-3, rim_m=2e-4, growth=3.0, spread=0.7)),
}
"""On the 24-pad sheet of the paper's size, error in units of a 2 mV noise at 0.1 mA, in the readings and in the 276
reciprocal numbers, for contact resistances of 10 ohm (1,000 ohm): fast 0.32, 1.6 (0.12, 0.6); fine 0.02, 0.10 (0.01,
0.04); reference 0.001, 0.003 (0.0003, 0.0015). ``discretisation`` measures it for any other sheet."""


class SheetModel:
    """Forward model of one sheet on one mesh: conductivity and contact resistances in, pair resistances out.

    ``quadrature_m`` (E,Q,2): where the conductivity is asked for. ``weight_m2`` (E,Q). ``electrode_size`` (L,): area
    in m² of a pad, length in m of an edge electrode; its product with the contact resistance is the specific impedance.
    ``contacts``: which nodes each electrode touches. ``fronts``: how the sheet is eliminated.
    """

    def __init__(self, sensor: Sensor, resolution: str | Resolution = "fine") -> None:
        """Raises ``MeshError`` if the sensor can't be meshed, ``KeyError`` for an unknown name of a resolution."""
        chosen = RESOLUTIONS[resolution] if isinstance(resolution, str) else resolution
        self._prepare(mesh_sheet(sensor, chosen.grading), chosen.degree)

    def refined(self) -> SheetModel:
        """The same sheet with every triangle cut into four."""
        return SheetModel.from_mesh(self.mesh.refined(), self.space.degree)

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
        self.contacts = [Contact.of(mesh, self.space, k) for k in range(mesh.electrodes)]
        self.electrode_size = np.array([contact.size for contact in self.contacts])
        self._number_entries()

    def _number_entries(self) -> None:
        """Entries of the matrix: the sheet's lower triangle, then the couplings of its nodes to the electrodes."""
        a, b = np.tril_indices(self.space.element.shape[1])
        nodes = self.space.nodes
        codes = [_code(self.space.element[:, a], self.space.element[:, b], nodes).ravel()]
        for contact in self.contacts:
            k, m = np.tril_indices(contact.cell.shape[1])
            codes.append(_code(contact.cell[:, k], contact.cell[:, m], nodes).ravel())
        unique, entry = np.unique(np.concatenate(codes), return_inverse=True)
        element, *touched = np.split(entry, np.cumsum([len(code) for code in codes])[:-1])
        mass = [contact.cell_mass[:, *np.tril_indices(contact.cell.shape[1])].ravel() for contact in self.contacts]
        touch = coo_array(_columns([(c.cell.ravel(), c.cell_mass.sum(axis=2).ravel()) for c in self.contacts], nodes))
        coupling = [
            (len(unique) + np.flatnonzero(touch.col == k), -touch.data[touch.col == k]) for k in range(len(mass))
        ]
        added = [
            (np.concatenate([where, entries]), np.concatenate([value, values]))
            for where, value, (entries, values) in zip(touched, mass, coupling, strict=True)
        ]
        row = np.concatenate([unique // nodes, nodes + touch.col])
        column = np.concatenate([unique % nodes, touch.row])
        self.fronts = Fronts.of(row, column, dissect(self.space), self.electrodes)
        rank = self.fronts.rank
        self._contact_map = _columns([(rank[entries], values) for entries, values in added], len(row))
        by_node = [len(unique) + np.flatnonzero(touch.col == k) for k in range(len(self.contacts))]
        self._cell_entries = [
            (rank[where].reshape(len(c.cell), -1), rank[mine[np.searchsorted(c.nodes, c.cell)]])
            for where, mine, c in zip(touched, by_node, self.contacts, strict=True)
        ]
        self._matrices = ElementMatrices.of(self.space, rank[element].reshape(len(self.space.element), -1))

    @property
    def electrodes(self) -> int:
        """Number of electrodes L."""
        return self.mesh.electrodes

    def uniform(self, sheet_resistance_ohm_sq: float) -> Array:
        """(E,Q) conductivity of a uniform sheet, in siemens."""
        return np.full(self.weight_m2.shape, 1.0 / sheet_resistance_ohm_sq)

    @cached_property
    def _cell_map(self) -> csr_array:
        """(entries, C) what each cell of the contacts, electrode by electrode, adds per siemens and area."""
        columns: list[tuple[Indices, Array]] = []
        for (where, coupled), contact in zip(self._cell_entries, self.contacts, strict=True):
            within = contact.cell_mass[:, *np.tril_indices(contact.cell.shape[1])]
            entries, value = np.hstack([where, coupled]), np.hstack([within, -contact.cell_mass.sum(axis=2)])
            columns += zip(entries, value, strict=True)
        return _columns(columns, self._contact_map.shape[0])

    @cached_property
    def cells(self) -> list[slice]:
        """Which of all contacts' cells (C,) are an electrode's."""
        ends = np.cumsum([0, *(len(contact.cell) for contact in self.contacts)]).tolist()
        return [slice(first, last) for first, last in pairwise(ends)]

    def solve(self, conductivity_s: Array, contact_resistance_ohm: Array, share: Array | None = None) -> Solution:
        """One conductivity (E,Q) in siemens (or (E,Q,3): xx, xy, yy) and contact resistances (L,) in ohm, with what
        each of their ``cells`` (C,) conducts per area over the mean of its contact, all the same by default.

        Raises ``ValueError`` for wrong shapes or resistances that aren't positive, ``LinAlgError`` where the
        conductivity isn't positive.
        """
        resistance = np.broadcast_to(np.asarray(contact_resistance_ohm, dtype=float), (self.electrodes,))
        if not (resistance > 0).all():
            raise ValueError("contact resistances must be positive")
        conductivity = self._checked(conductivity_s)
        per_size = 1.0 / (resistance * self.electrode_size)
        if share is None:
            value = self._contact_map @ per_size
        else:
            value = self._cell_map @ (np.repeat(per_size, [len(c.cell) for c in self.contacts]) * share)
        self._matrices.add(value, np.arange(len(conductivity)), conductivity)
        return Solution(self, conductivity, resistance, value, self.fronts.factor(value), share=share)

    def solve_again(self, conductivity_s: Array, base: Solution) -> Solution:
        """``solve`` with the contact resistances of ``base``; only what the elements that changed reach is done again.

        A press changes a few percent of the sheet. A scalar conductivity (E,Q) needs a scalar base, a tensor a tensor.
        """
        conductivity = self._checked(conductivity_s)
        base = base if base.origin is None else base.origin
        if conductivity.shape != base.conductivity_s.shape:
            raise ValueError(f"the base's conductivity has shape {base.conductivity_s.shape}, not {conductivity.shape}")
        changed = (conductivity != base.conductivity_s).reshape(len(conductivity), -1)
        elements = np.flatnonzero(changed.any(axis=1))
        return self.solve_part(elements, conductivity[elements], base)

    def solve_contacts(self, contact_resistance_ohm: Array, base: Solution) -> Solution:
        """``solve`` with the conductivity of ``base`` and other contact resistances (L,): only the pads' fronts again.

        Raises ``ValueError`` for resistances that aren't positive, or a base whose contacts are uneven.
        """
        resistance = np.broadcast_to(np.asarray(contact_resistance_ohm, dtype=float), (self.electrodes,))
        if not (resistance > 0).all():
            raise ValueError("contact resistances must be positive")
        base = base if base.origin is None else base.origin
        if base.share is not None:
            raise ValueError("uneven contacts can't be changed alone")
        if np.array_equal(resistance, base.contact_resistance_ohm):
            return base
        change = (1.0 / resistance - 1.0 / base.contact_resistance_ohm) / self.electrode_size
        value = base.entries + self._contact_map @ change
        dirty = self.fronts.affected(np.flatnonzero(np.diff(self._contact_map.indptr)))
        factor = self.fronts.refactor(value, dirty, base.factor)
        return Solution(self, base.given_s[:0], resistance, value, factor, base, np.zeros(0, dtype=np.intp))

    def solve_part(self, elements: Indices, conductivity_s: Array, base: Solution) -> Solution:
        """``solve_again`` where it is known that only ``elements`` (n,), each named once, have another conductivity.

        ``conductivity_s`` (n,Q) or (n,Q,3) in siemens, there alone.
        """
        base = base if base.origin is None else base.origin
        if not len(elements):
            return base
        dirty = self.fronts.affected(self._matrices.entry[elements].ravel())
        value = self.fronts.entries_of(dirty, base.entries)
        self._matrices.add(value, elements, conductivity_s - base.conductivity_s[elements])
        factor = self.fronts.refactor(value, dirty, base.factor)
        return Solution(
            self, conductivity_s, base.contact_resistance_ohm, value, factor, base, elements, share=base.share
        )

    def asked_at(self, elements: Indices) -> NDArray[np.bool_]:
        """The fronts to pass back through for potentials in some elements and on the electrodes; see
        ``Solution.confined``."""
        return self.fronts.holding(np.concatenate([self.space.element[elements].ravel(), self._touched]))

    @cached_property
    def _touched(self) -> Indices:
        return np.concatenate([contact.nodes for contact in self.contacts])

    def _checked(self, conductivity_s: Array) -> Array:
        conductivity = np.asarray(conductivity_s, dtype=float)
        scalar = self.weight_m2.shape
        if conductivity.shape not in (scalar, (*scalar, 3)):
            raise ValueError(f"conductivity has shape {conductivity.shape}; expected {scalar} or {(*scalar, 3)}")
        return conductivity

    def contact_losses(self, potential: Array, share: Array | None = None) -> Array:
        """(L,k,k) int_l (u_i - U_i)(u_j - U_j) over each electrode, for unit potentials on one electrode at a time,
        weighted by what its cells conduct (C,).

        ``potential`` (N,L): the fields of unit potential on each electrode, as ``Solution.potential``.
        """
        losses = np.empty((self.electrodes, self.electrodes, self.electrodes))
        for k, (contact, mine) in enumerate(zip(self.contacts, self.cells, strict=True)):
            drop = self._drop(potential, k)
            even = share is None or (share[mine] == 1).all()
            mass = contact.sparse_mass if share is None or even else contact.weighted_mass(share[mine])
            losses[k] = drop.T @ (mass @ drop)
        return losses

    def losses_by_form(self, potential: Array, electrodes: Indices) -> Array:
        """(q,J,k,k) ``contact_losses`` of some ``electrodes`` (q,), weighted by each of their contacts' forms."""
        drops = ((self.contacts[k], self._drop(potential, k)) for k in electrodes)
        return np.array([[drop.T @ (mass @ drop) for mass in contact.form_masses] for contact, drop in drops])

    def _drop(self, potential: Array, electrode: int) -> Array:
        """(n,L) voltage from an electrode's nodes to it."""
        drop = potential[self.contacts[electrode].nodes]
        drop[:, electrode] -= 1.0
        return np.asarray(drop)

    def contact_response(self, conductivity_s: Array, contact_resistance_ohm: Array, load: Array) -> Array:
        """(N,k) potentials that nodal currents ``load`` (N,k) drive with every electrode held at zero."""
        return self.solve(conductivity_s, contact_resistance_ohm).factor.solve(load)


@dataclass(frozen=True, eq=False)
class Solution:
    """Fields and transfer matrix of one conductivity; derivatives by the adjoint, dT_ij = -int ds grad u_i . grad u_j.

    ``entries``: the matrix's entries; ``factor``: what was eliminated. A solution in part has an ``origin``, whose
    conductivity, entries and fronts hold where nothing changed; ``given_s`` is then the conductivity of ``elements``.
    Where fronts are ``asked`` for, the potential is nought elsewhere. ``share`` (C,) of the contacts' cells, None where
    all conduct alike.
    """

    model: SheetModel
    given_s: Array
    contact_resistance_ohm: Array
    entries: Array
    factor: FrontalFactor
    origin: Solution | None = None
    elements: Indices | None = None
    asked: NDArray[np.bool_] | None = None
    share: Array | None = None

    @cached_property
    def conductivity_s(self) -> Array:
        """(E,Q) or (E,Q,3) conductivity everywhere, in siemens."""
        if self.origin is None:
            return self.given_s
        conductivity = self.origin.conductivity_s.copy()
        conductivity[self.elements] = self.given_s
        return conductivity

    @cached_property
    def transfer_ohm(self) -> Array:
        """(L,L) mean-free potentials of the electrodes in volt per ampere into each."""
        return transfer_of(self.conductance_s)

    @cached_property
    def conductance_s(self) -> Array:
        """(L,L) current out of each electrode per volt on each, in siemens."""
        return np.diag(1.0 / self.contact_resistance_ohm) + self.factor.remainder

    @cached_property
    def potential(self) -> Array:
        """(N,L) potential in the sheet for one volt on one electrode and none on the others, dimensionless."""
        return self.factor.potentials(self.asked)

    def confined(self, asked: NDArray[np.bool_]) -> Solution:
        """The same with potentials in the fronts ``asked`` alone (``SheetModel.asked_at``): less than half the work."""
        return replace(self, asked=asked)

    @cached_property
    def pair_resistance_ohm(self) -> Array:
        """(P,) pair resistances, P = L(L-1)/2."""
        return pair_resistances(self.transfer_ohm)

    def directional(self, conductivity_change_s: Array) -> Array:
        """(..., P) change in ohm of the pair resistances to first order for changes (..., E, Q) of the conductivity.

        Only the elements where some change isn't zero are visited.
        """
        change = np.asarray(conductivity_change_s, dtype=float)
        return self._contract(change[..., None], tensor=False)

    def directional_tensor(self, conductivity_change_s: Array) -> Array:
        """(..., P) the same for changes (..., E, Q, 3) of a conductivity tensor: xx, xy, yy."""
        return self._contract(np.asarray(conductivity_change_s, dtype=float), tensor=True)

    def _contract(self, change: Array, tensor: bool) -> Array:
        """Changes (..., E, Q, C) against the C products of fields, chunk by chunk over the elements touched."""
        weight = self.model.weight_m2
        flat = change.reshape(-1, *weight.shape, change.shape[-1])
        touched = np.flatnonzero(flat.any(axis=(0, 2, 3)))
        total = np.zeros((len(flat), self.model.electrodes * (self.model.electrodes + 1) // 2))
        step = max(1, CHUNK_POINTS // weight.shape[1])
        for first in range(0, len(touched), step):
            elements = touched[first : first + step]
            product = field_products(self.model.space, self.potential, elements, tensor)
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
        losses = pair_losses(self.model.space, self.potential @ self.transfer_ohm, self.model.weight_m2)
        return np.negative(losses, out=losses)

    def jacobian_contact_resistance(self) -> Array:
        """(P,L) derivative of each pair resistance by each contact resistance, dimensionless."""
        losses = self.model.contact_losses(self.potential, self.share)
        per_ohm = losses / (self.contact_resistance_ohm**2 * self.model.electrode_size)[:, None, None]
        return pair_resistances(self.transfer_ohm @ per_ohm @ self.transfer_ohm).T

    def jacobian_contact_lean(self, electrodes: Indices) -> Array:
        """(P,q,J) derivative of each pair resistance by how the contacts of some ``electrodes`` (q,) lean (their
        ``forms``), in ohm."""
        losses = self.model.losses_by_form(self.potential, electrodes)
        per_size = 1.0 / (self.contact_resistance_ohm * self.model.electrode_size)[electrodes]
        by_form = self.transfer_ohm @ (losses * per_size[:, None, None, None]) @ self.transfer_ohm
        return np.moveaxis(-pair_resistances(by_form), -1, 0)


def transfer_of(conductance_s: Array) -> Array:
    """Inverse (..., L, L) of conductances between electrodes on mean-free currents."""
    count = conductance_s.shape[-1]
    symmetric = 0.5 * (conductance_s + np.swapaxes(conductance_s, -1, -2))
    constant = np.trace(symmetric, axis1=-2, axis2=-1)[..., None, None] / count**2
    transfer = np.linalg.inv(symmetric + constant)
    transfer -= transfer.mean(axis=-2, keepdims=True)
    transfer -= transfer.mean(axis=-1, keepdims=True)
    return 0.5 * (transfer + np.swapaxes(transfer, -1, -2))


def _code(a: Indices, b: Indices, nodes: int) -> Indices:
    return np.maximum(a, b) * nodes + np.minimum(a, b)


def _columns(column: list[tuple[Indices, Array]], rows: int) -> csr_array:
    """(rows, L) sparse matrix with the given entries in each column; entries of the same row add up."""
    row = np.concatenate([indices for indices, _ in column])
    value = np.concatenate([values for _, values in column])
    number = np.repeat(np.arange(len(column)), [len(indices) for indices, _ in column])
    return csr_array(coo_array((value, (row, number)), shape=(rows, len(column))))
