"""Substructuring: tiles of the sheet condensed onto the lines between them, and only the pressed ones solved in full.

Each tile is condensed onto its border and the electrodes (Schur complement), tiles no press touches are eliminated
together, and a frame factorises the pressed tiles alone: exact, at the cost of a small part of the sheet
(Przemieniecki, AIAA J. 1, 1963).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import coo_matrix

from .sheet import Part, Sheet, _solver, transfer_of

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
TILE_M = 0.012


class Tiles:
    """A sheet cut into tiles. ``electric`` stands for (conductance, admittance, edge admittance) of all elements."""

    def __init__(self, sheet: Sheet, tile_m: float = TILE_M) -> None:
        self.sheet = sheet
        center = sheet.point_m.mean(axis=1)
        low = center.min(axis=0)
        count = np.maximum(1, np.round((center.max(axis=0) - low) / tile_m)).astype(int)
        cell = np.minimum(((center - low) / (np.ptp(center, axis=0) + 1e-12) * count).astype(int), count - 1)
        _, self.tile_of = np.unique(cell[:, 0] * count[1] + cell[:, 1], return_inverse=True)
        self.tiles = int(self.tile_of.max()) + 1
        owners = coo_matrix(
            (np.ones(sheet.dofs.size), (sheet.dofs.ravel(), np.repeat(self.tile_of, 6))),
            shape=(sheet.nodes, self.tiles),
        ).tocsr()
        self.skeleton = np.flatnonzero(np.diff(owners.indptr) > 1)
        self.parts = [Part(sheet, np.flatnonzero(self.tile_of == t), self.skeleton) for t in range(self.tiles)]
        self.place = np.full(sheet.nodes, -1, dtype=np.intp)
        self.place[self.skeleton] = np.arange(len(self.skeleton))

    def within(self, centers_m: Array, radius_m: float) -> Indices:
        """Tiles that have an element within the radius of any centre (n,2)."""
        at = self.sheet.point_m.mean(axis=1)
        near = np.hypot(*(at[:, None] - centers_m[None]).transpose(2, 0, 1)).min(axis=1) < radius_m
        return np.unique(self.tile_of[near])

    def _matrix(self, part: Part, electric: tuple[Array, Array, Array]) -> object:
        conductance, admittance, edge = electric
        return self.sheet.assemble(part, conductance[part.elements], admittance[part.elements], edge)

    def condense(self, electric: tuple[Array, Array, Array], tiles: Indices | None = None) -> dict[int, Array]:
        """Schur complement of each tile (of all without ``tiles``)."""
        chosen = range(self.tiles) if tiles is None else tiles
        return {int(t): self.parts[t].condensed(self._matrix(self.parts[t], electric)) for t in chosen}  # type: ignore[arg-type]

    def joined(self, condensed: dict[int, Array]) -> Array:
        """Sum of tiles' complements over the skeleton and the electrodes."""
        size = len(self.skeleton) + len(self.sheet.electrodes)
        total = np.zeros((size, size))
        electrodes = len(self.skeleton) + np.arange(len(self.sheet.electrodes))
        for tile, schur in condensed.items():
            at = np.concatenate([self.place[self.parts[tile].border], electrodes])
            total[np.ix_(at, at)] += schur
        return total

    def region(self, tiles: Indices) -> Region:
        """The tiles as one part of the sheet, to be solved in full."""
        return Region(self, tiles)


class Region:
    """Tiles solved in full while the others stand condensed."""

    def __init__(self, tiles: Tiles, chosen: Indices) -> None:
        self.tiles, self.chosen = tiles, chosen
        sheet = tiles.sheet
        self.elements = np.flatnonzero(np.isin(tiles.tile_of, chosen))
        others = np.unique(sheet.dofs[~np.isin(tiles.tile_of, chosen)])
        self.part = Part(sheet, self.elements, others)

    def outside(self, condensed: dict[int, Array]) -> Array:
        """Complement of everything else over this region's border and the electrodes."""
        rest = self.tiles.joined({t: s for t, s in condensed.items() if t not in set(self.chosen.tolist())})
        used = np.zeros(len(self.tiles.skeleton), dtype=bool)
        for t in condensed:
            if t not in self.chosen:
                used[self.tiles.place[self.tiles.parts[t].border]] = True
        border = self.tiles.place[self.part.border]
        gone = np.setdiff1d(np.flatnonzero(used), border)
        kept = np.concatenate([border, len(used) + np.arange(len(self.tiles.sheet.electrodes))])
        coupling = rest[np.ix_(gone, kept)]
        solved = cho_solve(cho_factor(rest[np.ix_(gone, gone)], check_finite=False), coupling, check_finite=False)
        return np.asarray(rest[np.ix_(kept, kept)] - coupling.T @ solved)

    def transfer(self, outside: Array, conductance: Array, admittance: Array, edge: Array) -> Array:
        """(L,L) transfer matrix in ohm for the electric state of this region's elements."""
        part, b = self.part, len(self.part.border)
        n, m = len(part.inner), len(part.inner) + b
        matrix = self.tiles.sheet.assemble(part, conductance, admittance, edge)
        dense = np.zeros((part.size - n,) * 2)
        dense[:] = matrix[n:, n:].toarray() + outside
        schur = dense - (matrix[n:, :n] @ self._inner(matrix, n))
        solved = np.linalg.solve(schur[:b, :b], schur[:b, b:]) if b else np.zeros((0, part.size - m))
        return transfer_of(schur[b:, b:] - schur[b:, :b] @ solved)

    @staticmethod
    def _inner(matrix: object, n: int) -> Array:
        return np.asarray(_solver(matrix[:n, :n]).solve(matrix[:n, n:].toarray()))  # type: ignore[index, attr-defined]
