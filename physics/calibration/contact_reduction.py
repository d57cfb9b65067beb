"""A small copy of the resting sheet for trying contact resistances: a reduced basis of its fields.

Under uniform conductivity the fields depend on the contact resistances alone, and through the current densities over
the electrodes. The sheet is solved for a few contact resistances spread over the range in question; the densities seen
on each electrode are compressed to a few shapes, and the fields that these shapes drive, each electrode on its own,
carry the same weak form with ten unknowns per electrode instead of thousands (Galerkin: the error is quadratic in the
basis's and is checked against the full model). With sheet resistance rho and contact resistances R everything depends
on x = R/rho only: pair resistances are rho r(x).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.protocol import pair_resistances

Array = NDArray[np.float64]

_NEGLIGIBLE = 1e-13
_SNAPSHOTS = 4


@dataclass(frozen=True, eq=False)
class ContactReduction:
    """The resting sheet of unit conductivity in B fields: ``stiffness`` (B,B), each contact's mass (L,B,B), load (B,L).

    ``electrode_size`` (L,) and ``range_squares`` (smallest, largest) contact resistance over sheet resistance the
    basis was made for.
    """

    stiffness: Array
    mass: Array
    load: Array
    electrode_size: Array
    range_squares: tuple[float, float]

    @classmethod
    def of(
        cls, model: SheetModel, smallest_squares: float, largest_squares: float, shapes: int = 10
    ) -> ContactReduction:
        """Reduction of the uniform sheet for contact resistances over sheet resistance within the given range."""
        ratios = np.geomspace(smallest_squares, largest_squares, _SNAPSHOTS)
        middle = float(np.sqrt(smallest_squares * largest_squares))
        densities = _current_shapes(model, ratios, shapes)
        field = model.contact_response(model.uniform(1.0), np.full(model.electrodes, middle), densities)
        mass = np.empty((model.electrodes, field.shape[1], field.shape[1]))
        load = np.empty((field.shape[1], model.electrodes))
        drive = np.zeros((field.shape[1], field.shape[1]))
        for number, contact in enumerate(model.contacts):
            under = field[contact.nodes]
            mass[number] = under.T @ contact.mass @ under
            load[:, number] = under.T @ contact.mass.sum(axis=1)
            drive += under.T @ densities[contact.nodes]
        # Each field solves its own system: its energy is what its shape feeds in, no integral over the sheet is needed.
        energy = 0.5 * (drive + drive.T)
        stiffness = energy - np.einsum("l,lij->ij", 1.0 / (middle * model.electrode_size), mass)
        scale = 1.0 / np.sqrt(np.diag(energy))
        value, vector = np.linalg.eigh(scale[:, None] * energy * scale)
        kept = value > _NEGLIGIBLE * value[-1]
        basis = scale[:, None] * vector[:, kept] / np.sqrt(value[kept])
        return cls(
            basis.T @ stiffness @ basis,
            basis.T @ mass @ basis,
            basis.T @ load,
            model.electrode_size,
            (smallest_squares, largest_squares),
        )

    def pair_resistance_ohm(self, contact_resistance_ohm: Array, sheet_resistance_ohm_sq: float) -> Array:
        """(P,) pair resistances for contact resistances (L,), all in ohm, and a sheet resistance in ohm per square."""
        transfer, _, _ = self._solve(np.asarray(contact_resistance_ohm) / sheet_resistance_ohm_sq)
        return sheet_resistance_ohm_sq * pair_resistances(transfer)

    def linearised(self, contact_resistance_ohm: Array, sheet_resistance_ohm_sq: float) -> tuple[Array, Array, Array]:
        """Pair resistances (P,) in ohm, their derivatives by each contact resistance (P,L), by the sheet's (P,).

        By the adjoint: only the loss in a contact changes with its resistance.
        """
        ratio = np.asarray(contact_resistance_ohm) / sheet_resistance_ohm_sq
        transfer, potential, per_size = self._solve(ratio)
        electrodes = len(ratio)
        cross = np.einsum("bl,bi->li", self.load, potential)
        losses = potential.T @ (self.mass @ potential)
        number = np.arange(electrodes)
        losses[number, number, :] -= cross
        losses[number, :, number] -= cross
        losses[number, number, number] += self.electrode_size
        losses *= (per_size**2 * self.electrode_size)[:, None, None]
        by_contact = pair_resistances(transfer @ losses @ transfer).T
        pairs = pair_resistances(transfer)
        return sheet_resistance_ohm_sq * pairs, by_contact, pairs - by_contact @ ratio

    def _solve(self, ratio: Array) -> tuple[Array, Array, Array]:
        """Transfer matrix (L,L), fields (B,L) of unit potentials and contact conductance per size (L,)."""
        per_size = 1.0 / (ratio * self.electrode_size)
        electrodes = len(ratio)
        flat = per_size @ self.mass.reshape(electrodes, -1)
        system = self.stiffness + flat.reshape(self.stiffness.shape)
        coupling = self.load * per_size
        potential = cho_solve(cho_factor(system, lower=True, check_finite=False), coupling, check_finite=False)
        conductance = np.diag(per_size * self.electrode_size) - coupling.T @ potential
        conductance = 0.5 * (conductance + conductance.T)
        constant = np.trace(conductance) / electrodes**2
        transfer = np.linalg.inv(conductance + constant)
        transfer -= transfer.mean(axis=0)
        transfer -= transfer.mean(axis=1, keepdims=True)
        return transfer, potential, per_size


def _current_shapes(model: SheetModel, ratios: Array, shapes: int) -> Array:
    """(N, L*shapes) nodal loads of the most frequent current densities on every electrode, one electrode a column."""
    solutions = [model.solve(model.uniform(1.0), np.full(model.electrodes, ratio)) for ratio in ratios]
    loads = []
    for number, contact in enumerate(model.contacts):
        drops = []
        for solution, ratio in zip(solutions, ratios, strict=True):
            drop = solution.potential[contact.nodes].copy()
            drop[:, number] -= 1.0
            drops.append(drop @ solution.transfer_ohm / ratio)
        lower = np.linalg.cholesky(contact.mass)
        vectors, _, _ = np.linalg.svd(lower.T @ np.hstack(drops), full_matrices=False)
        load = np.zeros((len(solutions[0].potential), 1 + min(shapes, vectors.shape[1])))
        load[contact.nodes, 0] = contact.mass.sum(axis=1)
        load[contact.nodes, 1:] = lower @ vectors[:, : load.shape[1] - 1]
        loads.append(load)
    return np.hstack(loads)
