"""What several contacts do to the pair resistances beyond the sum of what each does alone.

A press changes the sheet's conductance near its place. Seen from afar such a place is a polarisable body (Foldy, Phys.
Rev. 67 (1945) 107; Lax, Rev. Mod. Phys. 23 (1951) 287): the field it feels is that of the resting sheet and of all
other bodies. With the sheet cut into square cells k of area a_k, mean field e_k and change of conductance s_k,

    e + G a s e = e0,      dT = -e0' a s e,

where e0 is the resting field for one ampere into each electrode and G the field a unit dipole in one cell makes in
another. Only cells that are pressed enter: some dozens of unknowns where the sheet has thousands. Alone, cells are too
coarse; the difference between all together and each alone is what is taken from them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from ertskin.physics.conduction.sheet import Solution
from ertskin.physics.conduction.triangle import Space

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Interplay:
    """C cells of a resting sheet with L electrodes.

    ``center_m`` (C,2), ``area_m2`` (C,); ``field`` (C,2,L) mean gradient in 1/m of the potentials for one ampere into
    each electrode, in V/m; ``green`` (C,2,C,2) gradient in a cell for a unit dipole in another, in V/m per A m.
    """

    center_m: Array
    area_m2: Array
    field: Array
    green: Array

    @classmethod
    def of(cls, rest: Solution, cell_m: float) -> Interplay:
        """Cells of ``cell_m`` at most, whose fields are taken from the solved resting sheet ``rest``."""
        model = rest.model
        cell, center_m = _cells(model.quadrature_m.reshape(-1, 2), cell_m)
        weight = model.weight_m2.ravel()
        area = np.asarray(np.bincount(cell, weights=weight, minlength=len(center_m)), dtype=float)
        gradient = _mean_gradient(model.space, weight, cell, area)
        driven = gradient @ rest.potential
        load = np.asarray(gradient.T.toarray())
        grounded = gradient @ model.contact_response(rest.conductivity_s, rest.contact_resistance_ohm, load)
        cells, transfer = len(center_m), rest.transfer_ohm
        green = grounded + driven @ transfer @ driven.T
        field = (driven @ transfer).reshape(cells, 2, -1)
        return cls(center_m, area, field, np.asarray(green).reshape(cells, 2, cells, 2))

    def change_ohm(self, cells: list[Indices], change_s: list[Array]) -> Array:
        """(P,) ohm that contacts add together: contact c changes the conductance of ``cells[c]`` by ``change_s[c]``."""
        return pair_change(self._together(cells, change_s))

    def _together(self, cells: list[Indices], change_s: list[Array]) -> Array:
        owner = np.repeat(np.arange(len(cells)), [len(some) for some in cells])
        return interplay_ohm(
            self.field, self.green, self.area_m2, np.concatenate(cells), np.concatenate(change_s), owner
        )


def _cells(point_m: Array, cell_m: float) -> tuple[Indices, Array]:
    """Number of the cell each point (n,2) lies in, and the centres (C,2) of those that hold any."""
    low, high = point_m.min(axis=0), point_m.max(axis=0)
    count = np.maximum(1, np.ceil((high - low) / cell_m - 1e-6).astype(int))
    step = (high - low) / count
    index = np.minimum(((point_m - low) / step).astype(int), count - 1)
    used, number = np.unique(index[:, 0] * count[1] + index[:, 1], return_inverse=True)
    center = low + (np.stack(np.divmod(used, count[1]), axis=1) + 0.5) * step
    return number.ravel(), center


def _mean_gradient(space: Space, weight_m2: Array, cell: Indices, area_m2: Array) -> csr_array:
    """(2C,N) mean gradient over each cell of a potential at the N nodes."""
    slopes = space.gradients()
    points, nodes = slopes.shape[1], slopes.shape[3]
    value = slopes.reshape(-1, 2, nodes) * (weight_m2 / area_m2[cell])[:, None, None]
    row = np.broadcast_to((2 * cell)[:, None, None] + np.arange(2)[:, None], value.shape)
    column = np.broadcast_to(np.repeat(space.element, points, axis=0)[:, None], value.shape)
    entries = coo_array((value.ravel(), (row.ravel(), column.ravel())), shape=(2 * len(area_m2), space.nodes))
    return csr_array(entries)


def pair_change(transfer_ohm: Array) -> Array:
    """(P,) pair resistances of a change of the transfer matrix (L,L)."""
    i, j = np.triu_indices(len(transfer_ohm), 1)
    diagonal = np.diagonal(transfer_ohm)
    return np.asarray(diagonal[i] + diagonal[j] - transfer_ohm[i, j] - transfer_ohm[j, i])


@njit(cache=True, nogil=True)
def interplay_ohm(field, green, area_m2, cells, change_s, owner):  # type: ignore[no-untyped-def]
    """(L,L) ohm: change of the transfer matrix by all contacts together less those by each alone.

    ``cells`` (n,) pressed cells, ``change_s`` (n,) their change of conductance, ``owner`` (n,) whose contact each is.
    """
    n, electrodes = len(cells), field.shape[2]
    matrix = np.zeros((2 * n, 2 * n))
    alone = np.zeros((2 * n, 2 * n))
    source = np.empty((2 * n, electrodes))
    strength = np.empty(2 * n)
    for k in range(n):
        for a in range(2):
            strength[2 * k + a] = area_m2[cells[k]] * change_s[k]
            source[2 * k + a] = field[cells[k], a]
    for k in range(n):
        for m in range(n):
            for a in range(2):
                for b in range(2):
                    value = green[cells[k], a, cells[m], b] * strength[2 * m + b]
                    matrix[2 * k + a, 2 * m + b] = value
                    if owner[k] == owner[m]:
                        alone[2 * k + a, 2 * m + b] = value
    for k in range(2 * n):
        matrix[k, k] += 1.0
        alone[k, k] += 1.0
    # What differs is found from the smaller system's answer: (M^-1 - M0^-1) e0 = -M^-1 (M - M0) M0^-1 e0.
    felt = np.linalg.solve(alone, source)
    differs = -np.linalg.solve(matrix, (matrix - alone) @ felt)
    return -(source.T * strength) @ differs
