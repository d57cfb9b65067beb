"""Multifrontal Cholesky down to the conductance between the electrodes.

Duff and Reid, ACM TOMS 9 (1983) 302. Every set of the dissection is eliminated in a small dense *front* holding its
own nodes (the pivots) and the later nodes they touch; what remains is added to the front above. The electrodes come
last and stay: the root's remainder is the conductance between them, so no right-hand side is ever solved. Where only
few elements changed, only their fronts and those above are eliminated again. The potentials in the sheet cost one pass
back.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.physics.conduction.dissection import Dissection

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

TOGETHER = 3  # pivots eliminated together
BLOCK = 4  # rows substituted together


@dataclass(frozen=True, eq=False)
class Fronts:
    """The fronts of one sparsity pattern, numbered so that children come before parents.

    ``node``: unknowns of all fronts one after another, in elimination order within each, from ``node_start``;
    ``pivots`` (S,): how many of them the front eliminates; ``place``: where each node that remains of a front lies in
    the front above, from ``node_start`` too; ``child``: fronts below, from ``child_start``. The matrix's entries are
    numbered front by front: ``rank`` (entries,) gives the new number of each, ``home`` (entries,) the front of each new
    number, ``at`` its place there, from ``entry_start``.
    """

    unknowns: int
    electrodes: int
    node: Indices
    node_start: Indices
    pivots: Indices
    place: Indices
    parent: Indices
    child: Indices
    child_start: Indices
    rank: Indices
    at: Indices
    entry_start: Indices
    home: Indices

    @classmethod
    def of(cls, row: Indices, column: Indices, dissection: Dissection, electrodes: int) -> Fronts:
        """Fronts for symmetric matrices with entries ``row``, ``column``: the sheet's nodes, then the electrodes."""
        nodes = len(dissection.member)
        sets = len(dissection.parent)
        by_set = np.argsort(dissection.member, kind="stable")
        position = np.empty(nodes + electrodes, dtype=np.intp)
        position[by_set] = np.arange(nodes)
        position[nodes:] = np.arange(nodes, nodes + electrodes)
        ordered = np.concatenate([by_set, np.arange(nodes, nodes + electrodes)])
        pivots = np.bincount(dissection.member, minlength=sets)
        first_pivot = np.concatenate([[0], np.cumsum(pivots)])

        low, high = np.minimum(position[row], position[column]), np.maximum(position[row], position[column])
        member = np.concatenate([dissection.member, np.full(electrodes, sets)])
        home = member[ordered[low]]
        entry = np.argsort(home, kind="stable")
        entry_start = np.searchsorted(home[entry], np.arange(sets + 1))

        lists, remains = [], [np.zeros(0, dtype=np.intp)] * sets
        below: list[list[int]] = [[] for _ in range(sets)]
        for k, above in enumerate(dissection.parent):
            own = np.arange(first_pivot[k], first_pivot[k + 1])
            touched = [high[entry[entry_start[k] : entry_start[k + 1]]], *(remains[c] for c in below[k])]
            if above < 0:
                touched.append(np.arange(nodes, nodes + electrodes))
            later = np.unique(np.concatenate(touched))
            remains[k] = later[later >= first_pivot[k + 1]]
            lists.append(np.concatenate([own, remains[k]]))
            if above >= 0:
                below[above].append(k)

        node_start = np.concatenate([[0], np.cumsum([len(part) for part in lists])])
        place = [
            np.concatenate([np.zeros(pivots[k], dtype=np.intp), _positions(remains[k], lists, above)])
            for k, above in enumerate(dissection.parent)
        ]
        at = np.empty(len(entry), dtype=np.intp)
        for k, part in enumerate(lists):
            own_entries = entry[entry_start[k] : entry_start[k + 1]]
            i, j = np.searchsorted(part, low[own_entries]), np.searchsorted(part, high[own_entries])
            at[entry_start[k] : entry_start[k + 1]] = i * len(part) + j
        return cls(
            nodes,
            electrodes,
            ordered[np.concatenate(lists)],
            node_start,
            pivots,
            np.concatenate(place),
            np.asarray(dissection.parent),
            np.array([c for part in below for c in part], dtype=np.intp),
            np.concatenate([[0], np.cumsum([len(part) for part in below])]),
            np.argsort(entry),
            at,
            entry_start,
            home[entry],
        )

    @cached_property
    def size(self) -> Indices:
        """(S,) unknowns in each front."""
        return np.diff(self.node_start)

    def factor(self, value: Array) -> FrontalFactor:
        """Eliminate the sheet's nodes of the matrix with these entries; ``LinAlgError`` if not positive definite."""
        return self._eliminate(value, np.ones(len(self.pivots), dtype=bool), None)

    def holding(self, nodes: Indices) -> Flags:
        """(S,) the fronts in which some of the sheet's nodes are eliminated, and those above: what a pass back needs to
        come to these nodes."""
        flags = np.zeros(len(self.pivots), dtype=bool)
        _mark(flags, nodes, self._eliminated_in, self.parent)
        return flags

    @cached_property
    def _eliminated_in(self) -> Indices:
        """(N,) the front that eliminates each of the sheet's nodes."""
        found = np.empty(self.unknowns, dtype=np.intp)
        for k, count in enumerate(self.pivots):
            found[self.node[self.node_start[k] : self.node_start[k] + count]] = k
        return found

    def affected(self, entries: Indices) -> Flags:
        """(S,) the fronts that changes of these entries reach."""
        dirty = np.zeros(len(self.pivots), dtype=bool)
        _mark(dirty, entries, self.home, self.parent)
        return dirty

    def refactor(self, value: Array, dirty: Flags, base: FrontalFactor) -> FrontalFactor:
        """The same, where ``value`` differs from what ``base`` was factored from in the ``dirty`` fronts only.

        ``value`` is read in those fronts alone. ``base`` must be a factorisation of its own.
        """
        return self._eliminate(value, dirty, base)

    def entries_of(self, dirty: Flags, value: Array) -> Array:
        """(entries,) copy of the values that belong to some fronts; the others are left undefined."""
        copy = np.empty_like(value)
        _copy(copy, value, np.flatnonzero(dirty), self.entry_start)
        return copy

    def _eliminate(self, value: Array, dirty: Flags, base: FrontalFactor | None) -> FrontalFactor:
        need = np.where(dirty, self.size**2, 0)
        offset = np.concatenate([[0], np.cumsum(need)])
        work = np.empty(offset[-1])
        below, below_offset = (work, offset) if base is None else (base.work, base.offset)
        failed = _eliminate(
            np.flatnonzero(dirty), dirty, work, offset, below, below_offset, value, self.node_start, self.pivots,
            self.place, self.child, self.child_start, self.at, self.entry_start
        )  # fmt: skip
        if failed >= 0:
            raise np.linalg.LinAlgError("the conduction matrix isn't positive definite: conductivity must be positive")
        return FrontalFactor(self, dirty, work, offset, base)


@dataclass(frozen=True, eq=False)
class FrontalFactor:
    """Eliminated fronts; those not ``dirty`` are the ``base``'s."""

    fronts: Fronts
    dirty: Flags
    work: Array
    offset: Indices
    base: FrontalFactor | None

    @property
    def remainder(self) -> Array:
        """(L,L) what elimination leaves on the electrodes: their diagonal must still be added."""
        size, pivots = self.fronts.size[-1], self.fronts.pivots[-1]
        root = self.work[self.offset[-2] : self.offset[-1]].reshape(size, size)[pivots:, pivots:]
        return np.triu(root) + np.triu(root, 1).T

    def potentials(self, asked: Flags | None = None) -> Array:
        """(N,L) potentials in the sheet for unit potential on each electrode in turn; nought outside the fronts
        ``asked`` (S,), of which those above are some too."""
        electrodes = self.fronts.electrodes
        solved = np.zeros((self.fronts.unknowns + electrodes, electrodes))
        solved[self.fronts.unknowns :] = np.eye(electrodes)
        return self._back(solved, asked)

    def solve(self, right: Array) -> Array:
        """(N,k) potentials for currents (N,k) into the sheet's nodes, every electrode at zero."""
        solved = np.concatenate([right, np.zeros((self.fronts.electrodes, right.shape[1]))])
        _substitute(solved, *self._stored, self.fronts.node, self.fronts.node_start, self.fronts.pivots)
        solved[self.fronts.unknowns :] = 0.0
        return self._back(solved)

    def _back(self, solved: Array, asked: Flags | None = None) -> Array:
        which = np.arange(len(self.fronts.pivots)) if asked is None else np.flatnonzero(asked)
        fronts = self.fronts
        _substitute_back(solved, which[::-1], *self._stored, fronts.node, fronts.node_start, fronts.pivots)
        return solved[: self.fronts.unknowns]

    @property
    def _stored(self) -> tuple[Flags, Array, Indices, Array, Indices]:
        below = self if self.base is None else self.base
        return self.dirty, self.work, self.offset, below.work, below.offset


def _positions(remains: Indices, lists: list[Indices], above: int) -> Indices:
    return np.searchsorted(lists[above], remains) if above >= 0 else np.zeros(len(remains), dtype=np.intp)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _eliminate(  # type: ignore[no-untyped-def]
    which, dirty, work, offset, below, below_offset, value, node_start, pivots, place, child, child_start, at,
    entry_start
):  # fmt: skip
    """Fill and eliminate the fronts ``which``; the number of one that isn't positive definite, or -1."""
    for f in which:
        size = node_start[f + 1] - node_start[f]
        flat = work[offset[f] : offset[f] + size * size]
        flat[:] = 0.0
        for k in range(entry_start[f], entry_start[f + 1]):
            flat[at[k]] += value[k]
        front = flat.reshape(size, size)
        for k in range(child_start[f], child_start[f + 1]):
            c = child[k]
            extent = node_start[c + 1] - node_start[c]
            start = offset[c] if dirty[c] else below_offset[c]
            source = work if dirty[c] else below
            part = source[start : start + extent * extent].reshape(extent, extent)
            where = place[node_start[c] : node_start[c + 1]]
            for i in range(pivots[c], extent):
                target = front[where[i]]
                for j in range(i, extent):
                    target[where[j]] += part[i, j]
        if not _partial_cholesky(front, pivots[f]):
            return f
    return -1


@njit(cache=True, nogil=True, fastmath={"contract"})
def _partial_cholesky(a, pivots):  # type: ignore[no-untyped-def]
    """Eliminate the first pivots of the upper triangle in place: rows of U, then what remains."""
    size = len(a)
    for first in range(0, pivots, TOGETHER):
        last = min(first + TOGETHER, pivots)
        for k in range(first, last):
            if not a[k, k] > 0.0:
                return False
            a[k, k] = np.sqrt(a[k, k])
            row, scale = a[k, k + 1 :], 1.0 / a[k, k]
            for j in range(len(row)):
                row[j] *= scale
            for i in range(k + 1, last):
                _subtract(a, k, i)
        whole = last + (size - last) // 2 * 2 if last - first == TOGETHER else last
        for i in range(last, whole, 2):
            _subtract_block(a, first, i)
        for k in range(first, last):
            for i in range(whole, size):
                _subtract(a, k, i)
    return True


# Loops over whole slices, and few enough of them: else the compiler can't tell that no number that is read is one just
# written, and takes one number at a time.


@njit(cache=True, nogil=True, fastmath={"contract"})
def _subtract(a, k, i):  # type: ignore[no-untyped-def]
    """Take the products of pivot ``k`` from row ``i``."""
    p, row = a[k, i:], a[i, i:]
    c = p[0]
    for j in range(len(row)):
        row[j] -= c * p[j]


@njit(cache=True, nogil=True, fastmath={"contract"})
def _subtract_block(a, k, i):  # type: ignore[no-untyped-def]
    """The same for three pivots from ``k`` and two rows from ``i`` at once: each number loaded serves several
    products."""
    p, q, r = a[k, i:], a[k + 1, i:], a[k + 2, i:]
    row0, row1 = a[i, i:], a[i + 1, i:]
    p0, q0, r0, p1, q1, r1 = p[0], q[0], r[0], p[1], q[1], r[1]
    for j in range(len(row0)):
        pj, qj, rj = p[j], q[j], r[j]
        row0[j] = row0[j] - p0 * pj - q0 * qj - r0 * rj
        row1[j] = row1[j] - p1 * pj - q1 * qj - r1 * rj


@njit(cache=True, nogil=True)
def _mark(dirty, entries, home, parent):  # type: ignore[no-untyped-def]
    """Flag the fronts of some entries and all above them."""
    for entry in entries:
        dirty[home[entry]] = True
    for k in range(len(parent)):
        if dirty[k] and parent[k] >= 0:
            dirty[parent[k]] = True


@njit(cache=True, nogil=True)
def _copy(copy, value, which, entry_start):  # type: ignore[no-untyped-def]
    for f in which:
        for k in range(entry_start[f], entry_start[f + 1]):
            copy[k] = value[k]


@njit(cache=True, nogil=True, fastmath={"contract"})
def _substitute(solved, dirty, work, offset, below, below_offset, node, node_start, pivots):  # type: ignore[no-untyped-def]
    """Forward substitution in place, children before parents."""
    columns = solved.shape[1]
    for f in range(len(pivots)):
        size = node_start[f + 1] - node_start[f]
        start = offset[f] if dirty[f] else below_offset[f]
        source = work if dirty[f] else below
        front = source[start : start + size * size].reshape(size, size)
        where = node[node_start[f] : node_start[f + 1]]
        for k in range(pivots[f]):
            pivot = solved[where[k]]
            for s in range(columns):
                pivot[s] /= front[k, k]
            for j in range(k + 1, size):
                c = front[k, j]
                row = solved[where[j]]
                for s in range(columns):
                    row[s] -= c * pivot[s]


@njit(cache=True, nogil=True, fastmath={"contract"})
def _substitute_back(solved, which, dirty, work, offset, below, below_offset, node, node_start, pivots):  # type: ignore[no-untyped-def]
    """Back substitution in place in some fronts, from the root down."""
    columns = solved.shape[1]
    for f in which:
        size = node_start[f + 1] - node_start[f]
        start = offset[f] if dirty[f] else below_offset[f]
        source = work if dirty[f] else below
        front = source[start : start + size * size].reshape(size, size)
        where = node[node_start[f] : node_start[f + 1]]
        total = np.empty(columns)
        for k in range(pivots[f] - 1, -1, -1):
            total[:] = solved[where[k]]
            whole = k + 1 + (size - k - 1) // BLOCK * BLOCK
            for j in range(k + 1, whole, BLOCK):
                c0, c1, c2, c3 = front[k, j], front[k, j + 1], front[k, j + 2], front[k, j + 3]
                row0, row1, row2, row3 = (
                    solved[where[j]], solved[where[j + 1]], solved[where[j + 2]], solved[where[j + 3]]
                )  # fmt: skip
                for s in range(columns):
                    total[s] -= c0 * row0[s] + c1 * row1[s] + c2 * row2[s] + c3 * row3[s]
            for j in range(whole, size):
                c, row = front[k, j], solved[where[j]]
                for s in range(columns):
                    total[s] -= c * row[s]
            for s in range(columns):
                solved[where[k], s] = total[s] / front[k, k]
