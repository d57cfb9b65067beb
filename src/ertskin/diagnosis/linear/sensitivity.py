"""What a small change of the sheet or of an electrode's place does to a whitened scan, by the adjoint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, sparray

from ertskin.physics.conduction.field_products import gathered_products
from ertskin.physics.conduction.sheet import SheetModel, Solution
from ertskin.physics.protocol import Protocol, pair_resistances

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

RIM_RULE = {1: np.array([1, 1]) / 2, 2: np.array([1, 1, 4]) / 6, 3: np.array([1, 1, 3, 3]) / 8}
"""Newton-Cotes weights of an edge's nodes, the ends first."""


class Hats:
    """Bilinear hat functions on a regular grid: ``node_m`` (G,2) and the spacing."""

    def __init__(self, first_m: Array, last_m: Array, spacing_m: float) -> None:
        count = np.maximum(np.ceil((last_m - first_m) / spacing_m - 1e-9).astype(int), 1) + 1
        self.axes = [first_m[k] + (last_m[k] - first_m[k]) * np.linspace(0, 1, count[k]) for k in range(2)]
        self.node_m = np.stack([np.tile(self.axes[0], count[1]), np.repeat(self.axes[1], count[0])], axis=1)

    def values(self, position_m: Array) -> csr_array:
        """(G, n) sparse values of the hats at positions (n,2); positions outside the grid belong to no hat."""
        rows, columns, entries = [], [], []
        inside = np.ones(len(position_m), dtype=bool)
        cell, share = [], []
        for k in range(2):
            axis = self.axes[k]
            inside &= (position_m[:, k] >= axis[0] - 1e-12) & (position_m[:, k] <= axis[-1] + 1e-12)
            index = np.clip(np.searchsorted(axis, position_m[:, k], side="right") - 1, 0, len(axis) - 2)
            cell.append(index)
            share.append((position_m[:, k] - axis[index]) / (axis[index + 1] - axis[index]))
        point = np.flatnonzero(inside)
        for dx in (0, 1):
            for dy in (0, 1):
                weight = (share[0] if dx else 1 - share[0]) * (share[1] if dy else 1 - share[1])
                rows.append(((cell[1] + dy) * len(self.axes[0]) + cell[0] + dx)[point])
                columns.append(point)
                entries.append(weight[point])
        shape = (len(self.node_m), len(position_m))
        return csr_array((np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))), shape=shape)


def pairs_of_transfer(electrodes: int) -> Array:
    """(L(L+1)/2, P) pair resistances of transfer matrices of which one entry of the lower triangle, and its mirror
    image, is one."""
    i, j = np.tril_indices(electrodes)
    unit = np.zeros((len(i), electrodes, electrodes))
    unit[np.arange(len(i)), i, j] = 1.0
    unit[np.arange(len(i)), j, i] = 1.0
    return pair_resistances(unit)


def whitening_of_transfer(protocol: Protocol) -> Array:
    """(P, L(L+1)/2) whitened coordinates of a change of the transfer matrix given by its lower triangle."""
    return protocol.whitened(pairs_of_transfer(protocol.electrodes)).T


@dataclass(frozen=True, eq=False)
class Potentials:
    """A solution without what was eliminated for it, most of its size: its ``potential`` (N,L) and ``transfer_ohm``
    (L,L)."""

    model: SheetModel
    potential: Array
    transfer_ohm: Array

    @classmethod
    def of(cls, solution: Solution) -> Potentials:
        """Those of a solution."""
        return cls(solution.model, solution.potential, solution.transfer_ohm)


def sheet_sensitivity(
    solution: Solution | Potentials, elements: Indices, hats: sparray, whitening: Array, tensors: Array, scale: Array
) -> NDArray[np.float32]:
    """(C, P, G) change of the whitened scan in volt for a conductance change hat_g(x) scale(x) A_c, A_c in ``tensors``.

    ``hats`` (G, n) at the elements' quadrature points (n = E*Q), ``scale`` (n,) in siemens, ``tensors`` (C,3) of xx,
    xy, yy. In single precision: what is integrated once needs no more.
    """
    model = solution.model
    current = solution.potential @ solution.transfer_ohm
    weight = model.weight_m2[elements].ravel() * scale
    total = gathered_products(model.space, current, elements, tensors, hats.tocsc(), weight)
    return np.asarray(-whitening.astype(np.float32) @ total.transpose(0, 2, 1))


class PadRims:
    """The rims of the pads inside the sheet and the ends of electrodes on its edge: the shape derivative of a displaced
    electrode lives there."""

    def __init__(self, model: SheetModel) -> None:
        self.model = model
        self.pad: list[tuple[int, Indices, Array]] = []
        for k in range(model.electrodes):
            inside = np.flatnonzero(model.mesh.pad == k)
            if len(inside):
                self.pad.append((k, *self._rim(inside)))
        self.edge = [(k, *self._ends(side)) for k, side in enumerate(model.mesh.edge) if len(side)]

    def _rim(self, inside: Indices) -> tuple[Indices, Array]:
        """Nodes (n,degree+1) along the rim's edges and the edges' outward normals times their lengths (n,2)."""
        mesh, space = self.model.mesh, self.model.space
        corners = mesh.triangle[inside]
        around = [[0, 1], [1, 2], [2, 0]]
        side = corners[:, around].reshape(-1, 2)
        code = np.sort(side, axis=1) @ np.array([1 << 31, 1])
        _, first, count = np.unique(code, return_index=True, return_counts=True)
        rim = side[first[count == 1]]
        along = mesh.point_m[rim[:, 1]] - mesh.point_m[rim[:, 0]]
        return space.edge_nodes(rim), np.stack([along[:, 1], -along[:, 0]], axis=1)

    def _ends(self, side: Indices) -> tuple[Indices, Array]:
        """Nodes (2,) at the first and the last end of an electrode's mesh edges (n,2), and the way (2,) on which its
        middle goes, by which a shift of the middle is one along the outline."""
        first, last = (np.setdiff1d(side[:, k], side[:, 1 - k]) for k in range(2))
        at_ends = side[np.concatenate([np.flatnonzero(side[:, 0] == first), np.flatnonzero(side[:, 1] == last)])]
        along = np.diff(self.model.mesh.point_m[at_ends], axis=1)[:, 0]
        way = (along / np.hypot(*along.T)[:, None]).mean(axis=0)
        return np.concatenate([first, last]), way / (way @ way)

    def sensitivity(self, solution: Solution, protocol: Protocol) -> Array:
        """(P, L, 2) change of the whitened scan in volt per metre by which an electrode is shifted along x and y.

        The contact form 1/z int (u - U)(v - V) changes by its integrand along a pad's rim times the normal shift; on
        the sheet's edge, by that at its last end less that at its first, for a shift along the edge.
        """
        rule = RIM_RULE[self.model.space.degree]
        electrodes = self.model.electrodes
        form = np.zeros((electrodes, 2, electrodes, electrodes))
        for k, nodes, outward in self.pad:
            drop = solution.potential[nodes]
            drop[..., k] -= 1.0
            per_size = 1.0 / (solution.contact_resistance_ohm[k] * self.model.electrode_size[k])
            weight = per_size * outward.T[:, :, None] * rule
            flat = drop.reshape(-1, electrodes)
            form[k] = (weight.reshape(2, -1, 1) * flat).transpose(0, 2, 1) @ flat
        for k, ends, way in self.edge:
            drop = solution.potential[ends]
            drop[..., k] -= 1.0
            first, last = (np.outer(one, one) for one in drop)
            per_size = 1.0 / (solution.contact_resistance_ohm[k] * self.model.electrode_size[k])
            form[k] = per_size * way[:, None, None] * (last - first)
        change = -solution.transfer_ohm @ form @ solution.transfer_ohm
        found = protocol.whitened(pair_resistances(change.reshape(-1, electrodes, electrodes)))
        return np.asarray(found.T.reshape(-1, electrodes, 2))
