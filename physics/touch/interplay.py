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

TOGETHER = 4
"""Rows eliminated at once."""


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

    def __post_init__(self) -> None:
        """In one type and layout whatever they came from, or numba compiles anew what takes them."""
        for name in ("center_m", "area_m2", "field", "green"):
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), dtype=float))

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
        begin = np.cumsum([0, *(len(some) for some in cells)])
        return interplay_ohm(
            self.field, self.green, self.area_m2, np.concatenate(cells), np.concatenate(change_s), begin
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
def interplay_ohm(field, green, area_m2, cells, change_s, begin):  # type: ignore[no-untyped-def]
    """(L,L) ohm: change of the transfer matrix by all contacts together less those by each alone.

    ``cells`` (n,) pressed cells, ``change_s`` (n,) their change of conductance, none of it nought; ``begin`` (C+1,):
    where each contact's cells begin. With s = a_k s_k the equation is (s + s G s) e = s e0, which is symmetric; its
    elimination needs no pivots, which are ratios of conductances' determinants.
    """
    contacts, electrodes = len(begin) - 1, field.shape[2]
    first = np.zeros(contacts + 1, dtype=np.int64)
    for c in range(contacts):
        first[c + 1] = first[c] + -(-2 * (begin[c + 1] - begin[c]) // TOGETHER) * TOGETHER
    rows = _scattering(field, green, area_m2, cells, change_s, begin, first)
    unknowns = len(rows)
    total = np.zeros((electrodes, electrodes))
    # Eliminated together the first contact's rows are what they are alone: they take no part in the difference.
    for c in range(1, contacts + 1):
        some, begins, sign = rows, first[1], -1.0
        if c < contacts:
            many = first[c + 1] - first[c]
            some, begins, sign = np.empty((many, many + electrodes)), 0, 1.0
            for k in range(many):
                for j in range(many + electrodes):
                    some[k, j] = rows[first[c] + k, first[c] + j if j < many else unknowns - many + j]
        _eliminated(some)
        _add_products(some, begins, sign, total)
    return total


@njit(inline="always")
def _scattering(field, green, area_m2, cells, change_s, begin, first):  # type: ignore[no-untyped-def]
    """(n,n+L) s + s G s, of which only what lies right of the diagonal, and s e0: contact c's from row ``first[c]``
    on, then rows that stand for nothing, as many as are needed for whole groups."""
    contacts, electrodes, unknowns = len(begin) - 1, field.shape[2], first[-1]
    rows = np.zeros((unknowns, unknowns + electrodes))
    for c in range(contacts):
        for k in range(begin[c], begin[c + 1]):
            strength = area_m2[cells[k]] * change_s[k]
            for a in range(2):
                at = first[c] + 2 * (k - begin[c]) + a
                row, seen = rows[at], green[cells[k], a]
                for d in range(c, contacts):
                    to = first[d] - 2 * begin[d]
                    for m in range(begin[d], begin[d + 1]):
                        both = strength * area_m2[cells[m]] * change_s[m]
                        row[to + 2 * m] = both * seen[cells[m], 0]
                        row[to + 2 * m + 1] = both * seen[cells[m], 1]
                row[at] += strength
                for j in range(electrodes):
                    row[unknowns + j] = strength * field[cells[k], a, j]
        for at in range(first[c] + 2 * (begin[c + 1] - begin[c]), first[c + 1]):
            rows[at, at] = 1.0
    return rows


@njit(inline="always")
def _eliminated(rows):  # type: ignore[no-untyped-def]
    """Eliminate forward, in place, in symmetric equations (n,n+m) with their right hand sides, n in whole groups.

    What lies left of the diagonal is neither read nor made nought. Four rows at once: a row is fetched a quarter as
    often, which is what this costs.
    """
    count = len(rows)
    for k in range(0, count, TOGETHER):
        for a in range(k, k + TOGETHER):
            for b in range(a + 1, k + TOGETHER):
                share = rows[a, b] / rows[a, a]
                for j in range(k, rows.shape[1]):
                    rows[b, j] -= share * rows[a, j]
        i0, i1, i2, i3 = 1.0 / rows[k, k], 1.0 / rows[k + 1, k + 1], 1.0 / rows[k + 2, k + 2], 1.0 / rows[k + 3, k + 3]
        for i in range(k + TOGETHER, count):
            f0, f1, f2, f3 = rows[k, i] * i0, rows[k + 1, i] * i1, rows[k + 2, i] * i2, rows[k + 3, i] * i3
            # From an even start on, for whole vectors.
            start = i // 8 * 8
            r0, r1, r2, r3 = rows[k, start:], rows[k + 1, start:], rows[k + 2, start:], rows[k + 3, start:]
            row = rows[i, start:]
            for j in range(len(row)):
                row[j] -= f0 * r0[j] + f1 * r1[j] + f2 * r2[j] + f3 * r3[j]


@njit(inline="always")
def _add_products(rows, begin, sign, total):  # type: ignore[no-untyped-def]
    """Add to ``total`` (L,L), with that sign, what the eliminated ``rows`` (n,n+L) from ``begin`` on make of it."""
    right, count = len(rows), len(total)
    for k in range(begin, right, TOGETHER):
        r0, r1, r2, r3 = rows[k, right:], rows[k + 1, right:], rows[k + 2, right:], rows[k + 3, right:]
        w0, w1 = sign / rows[k, k], sign / rows[k + 1, k + 1]
        w2, w3 = sign / rows[k + 2, k + 2], sign / rows[k + 3, k + 3]
        for i in range(count):
            f0, f1, f2, f3 = w0 * r0[i], w1 * r1[i], w2 * r2[i], w3 * r3[i]
            row = total[i]
            for j in range(count):
                row[j] += f0 * r0[j] + f1 * r1[j] + f2 * r2[j] + f3 * r3[j]
