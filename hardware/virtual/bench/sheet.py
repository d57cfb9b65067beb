"""The bench's sheet: spectral elements on a tensor grid, eliminated by a hierarchical merge of Schur complements.

Rectangular elements aligned to the pads' rims, nodes and quadrature at the Gauss-Lobatto points, so the contact terms
are diagonal and the rims are element edges. Every element is condensed to its edge, then rectangles are merged two by
two (Martinsson, A direct solver for variable coefficient elliptic PDEs discretized via a composite spectral
collocation method, J. Comput. Phys. 242, 2013): what stays at the root is the admittance between the electrodes.
A change somewhere recomputes only the branch above it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dpotrf

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def gauss_lobatto(degree: int) -> tuple[Array, Array, Array]:
    """Nodes and weights on [-1,1] (degree+1,) and the derivative matrix D[q,a] = l_a'(x_q)."""
    inner = legendre.Legendre.basis(degree).deriv().roots()
    x = np.concatenate([[-1.0], np.sort(inner.real), [1.0]])
    p = legendre.Legendre.basis(degree)(x)
    weight = 2.0 / (degree * (degree + 1) * p**2)
    gap = x[:, None] - x[None, :]
    np.fill_diagonal(gap, 1.0)
    derivative = p[:, None] / p[None, :] / gap
    np.fill_diagonal(derivative, 0.0)
    np.fill_diagonal(derivative, -derivative.sum(axis=1))
    return x, weight, derivative


def graded_lines(length_m: float, rims_m: Array, largest_m: float) -> Array:
    """Element lines from 0 to ``length_m`` through every rim, no gap wider than ``largest_m``."""
    fixed = np.unique(np.round(np.concatenate([[0.0, length_m], rims_m]), 9))
    lines = [fixed[:1]]
    for low, high in pairwise(fixed):
        pieces = max(1, int(np.ceil((high - low) / largest_m - 1e-9)))
        lines.append(low + (high - low) * np.arange(1, pieces + 1) / pieces)
    return np.concatenate(lines)


@dataclass(frozen=True, eq=False)
class _Merge:
    """How two condensed rectangles become one: positions of their unknowns, separator first."""

    first: int
    second: int
    into_first: Index
    into_second: Index
    size: int
    separator: int


class SpectralSheet:
    """A rectangular sheet [0,Lx]x[0,Ly] with rectangular pads touching it over their whole area.

    ``points_m`` (E,Q,2) are the points where the conductivity is asked for; ``pad`` (E,) the pad an element lies
    under, -1 for none. ``degree`` and ``largest_m`` set the resolution.
    """

    def __init__(
        self, size_m: Sequence[float], center_m: Array, pad_size_m: Array, degree: int = 8, largest_m: float = 0.0046
    ) -> None:
        self.degree, self.electrodes = degree, len(center_m)
        self._x, self._weight, self._derivative = gauss_lobatto(degree)
        low, high = center_m - pad_size_m / 2, center_m + pad_size_m / 2
        self.lines = [
            graded_lines(float(size_m[axis]), np.concatenate([low[:, axis], high[:, axis]]), largest_m)
            for axis in (0, 1)
        ]
        columns, rows = len(self.lines[0]) - 1, len(self.lines[1]) - 1
        self.shape = (columns, rows)
        self._step = [np.diff(line) for line in self.lines]
        column, row = (index.ravel() for index in np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"))
        self._hx, self._hy = self._step[0][column], self._step[1][row]
        mid = np.stack([self.lines[0][column] + self._hx / 2, self.lines[1][row] + self._hy / 2], axis=1)
        inside = np.all((mid[:, None] > low) & (mid[:, None] < high), axis=-1)
        self.pad = np.where(inside.any(axis=1), inside.argmax(axis=1), -1)
        self.pad_area_m2 = pad_size_m.prod(axis=1)
        nodes = degree + 1
        a, b = (index.ravel() for index in np.meshgrid(np.arange(nodes), np.arange(nodes), indexing="ij"))
        self.points_m = mid[:, None] + 0.5 * np.stack(
            [self._hx[:, None] * self._x[a], self._hy[:, None] * self._x[b]], axis=-1
        )
        self.weight_m2 = 0.25 * (self._hx * self._hy)[:, None] * (self._weight[a] * self._weight[b])
        edge = (a == 0) | (a == degree) | (b == 0) | (b == degree)
        self._edge, self._inner = np.flatnonzero(edge), np.flatnonzero(~edge)
        self._node_rows = rows * degree + 1
        self._global = (column[:, None] * degree + a) * self._node_rows + row[:, None] * degree + b
        self._plan()

    def _plan(self) -> None:
        """The tree of rectangles: leaves are elements, then merges in the order they can be done."""
        columns, rows = self.shape
        n, last_x, last_y = self.degree, columns * self.degree, rows * self.degree
        self._unknowns: list[Index] = []
        electrode_base = (last_x + 1) * self._node_rows
        for element in range(columns * rows):
            ids = self._global[element, self._edge]
            own = [electrode_base + self.pad[element]] if self.pad[element] >= 0 else []
            self._unknowns.append(np.concatenate([ids, np.array(own, dtype=np.intp)]))
        self._merges: list[_Merge] = []
        self._parent = np.full(2 * columns * rows - 1, -1, dtype=np.intp)

        def outside(ids: Index, box: tuple[int, int, int, int]) -> NDArray[np.bool_]:
            """Unknowns that other rectangles, or the world, still need."""
            i, j = ids // self._node_rows, ids % self._node_rows
            i0, i1, j0, j1 = (n * side for side in box)
            rim = ((i == i0) & (i0 > 0)) | ((i == i1) & (i1 < last_x))
            rim |= ((j == j0) & (j0 > 0)) | ((j == j1) & (j1 < last_y))
            return rim | (ids >= electrode_base)

        def build(i0: int, i1: int, j0: int, j1: int) -> int:
            if i1 - i0 == 1 and j1 - j0 == 1:
                return i0 * rows + j0
            if i1 - i0 >= j1 - j0:
                middle = (i0 + i1) // 2
                first, second = build(i0, middle, j0, j1), build(middle, i1, j0, j1)
            else:
                middle = (j0 + j1) // 2
                first, second = build(i0, i1, j0, middle), build(i0, i1, middle, j1)
            union = np.union1d(self._unknowns[first], self._unknowns[second])
            keep = outside(union, (i0, i1, j0, j1))
            ordered = np.concatenate([union[~keep], union[keep]])
            place = np.argsort(ordered)
            into = [place[np.searchsorted(ordered, self._unknowns[one], sorter=place)] for one in (first, second)]
            # Places in a flat matrix: filling one so takes half the time of rows and columns.
            flat = [(one[:, None] * len(ordered) + one).ravel() for one in into]
            self._merges.append(_Merge(first, second, flat[0], flat[1], len(ordered), int((~keep).sum())))
            self._unknowns.append(union[keep])
            node = len(self._unknowns) - 1
            self._parent[[first, second]] = node
            return node

        build(0, columns, 0, rows)

    @property
    def elements(self) -> int:
        """Number of elements E."""
        return len(self.pad)

    def condense(self, element: Index, conductivity_s: Array, contact_ohm: Array) -> list[Array]:
        """Schur complements of some elements on their edges (and pad), from conductivity (n,Q) or (n,Q,3) siemens."""
        full = self._stiffness(element, conductivity_s)
        pad = self.pad[element]
        under = pad >= 0
        exchange = np.zeros(full.shape[:2])
        exchange[under] = (
            self.weight_m2[element[under]] / (contact_ohm[pad[under]] * self.pad_area_m2[pad[under]])[:, None]
        )
        diagonal = np.arange(full.shape[1])
        full[:, diagonal, diagonal] += exchange
        edge, inner = self._edge, self._inner
        border = np.empty((len(element), len(edge) + 1, len(inner)))
        border[:, :-1] = full[:, edge[:, None], inner]
        border[:, -1] = -exchange[:, inner]
        schur = np.zeros((len(element), len(edge) + 1, len(edge) + 1))
        schur[:, :-1, :-1] = full[:, edge[:, None], edge]
        schur[:, -1, :-1] = schur[:, :-1, -1] = -exchange[:, edge]
        schur[:, -1, -1] = exchange.sum(axis=1)
        solved = np.linalg.solve(full[:, inner[:, None], inner], border.transpose(0, 2, 1))
        schur -= border @ solved
        return [matrix if on_pad else matrix[:-1, :-1] for matrix, on_pad in zip(schur, under, strict=True)]

    def _stiffness(self, element: Index, conductivity_s: Array) -> Array:
        """(n,Q,Q) element matrices of int grad v . sigma grad u, quadrature at the nodes."""
        nodes = self.degree + 1
        d, w = self._derivative, self._weight
        tensor = conductivity_s if conductivity_s.ndim == 3 else None
        grid = conductivity_s if tensor is None else tensor[..., 0]
        sxx = grid.reshape(-1, nodes, nodes)
        syy = sxx if tensor is None else tensor[..., 1].reshape(-1, nodes, nodes)
        ww = w[:, None] * w
        ratio = (self._hy / self._hx)[element][:, None, None]
        square = np.einsum("qa,qb->qab", d, d).reshape(nodes, -1)
        along = (sxx * ww * ratio).transpose(0, 2, 1) @ square
        across = (syy * ww / ratio) @ square
        full = np.zeros((len(element), nodes, nodes, nodes, nodes))
        k = np.arange(nodes)
        full[:, :, k, :, k] += along.reshape(-1, nodes, nodes, nodes).transpose(1, 0, 2, 3)
        full[:, k, :, k, :] += across.reshape(-1, nodes, nodes, nodes).transpose(1, 0, 2, 3)
        if tensor is not None and np.any(tensor[..., 2]):
            sxy = tensor[..., 2].reshape(-1, nodes, nodes) * ww
            mixed = np.einsum("nbj,ba,jc->najbc", sxy, d, d, optimize=True)
            full += mixed + mixed.transpose(0, 3, 4, 1, 2)
        return full.reshape(len(element), nodes**2, nodes**2)

    def factor(self, conductivity_s: Array, contact_ohm: Array) -> Factor:
        """Eliminate the whole sheet; ``conductivity_s`` (E,Q), or (E,Q,3) as xx, yy, xy; ``contact_ohm`` (L,)."""
        every = np.arange(self.elements)
        blocks: list[Array] = []
        for part in np.array_split(every, max(1, self.elements // 64)):
            blocks += self.condense(part, conductivity_s[part], contact_ohm)
        for merge in self._merges:
            blocks.append(_merged(merge, blocks[merge.first], blocks[merge.second]))
        return Factor(self, blocks, np.array(contact_ohm, dtype=float))

    def branch(self, element: Index) -> Index:
        """Merges to redo, in order, after these elements change."""
        stale = np.zeros(len(self._parent), dtype=bool)
        above = np.unique(self._parent[element])
        while len(above):
            stale[above] = True
            above = np.unique(self._parent[above])
            above = above[above >= 0]
        return np.flatnonzero(stale[self.elements :])


def _merged(merge: _Merge, first: Array, second: Array) -> Array:
    flat = np.zeros(merge.size**2)
    flat[merge.into_first] = first.ravel()
    flat[merge.into_second] += second.ravel()
    # Symmetric, so that the order LAPACK likes costs nothing.
    front = flat.reshape(merge.size, merge.size).T
    s = merge.separator
    chol, info = dpotrf(front[:s, :s], lower=1, clean=0)
    if info:
        raise np.linalg.LinAlgError("the sheet's matrix is not positive definite: a conductivity is not positive")
    half = dtrsm(1.0, chol, front[:s, s:], lower=1)
    return front[s:, s:] - half.T @ half


@dataclass(frozen=True, eq=False)
class Factor:
    """An eliminated sheet, from which a locally changed one costs only the branch above the change."""

    sheet: SpectralSheet
    blocks: list[Array]
    contact_ohm: Array

    @property
    def transfer_ohm(self) -> Array:
        """(L,L) mean-free transfer matrix."""
        return _transfer(self.blocks[-1])

    def changed(self, element: Index, conductivity_s: Array, contact_ohm: Array | None = None) -> Factor:
        """The sheet with new conductivity (n,Q) or (n,Q,3) on the elements given, and new contact resistances.

        An electrode whose contact resistance changes must have all its elements among those given.
        """
        contact = self.contact_ohm if contact_ohm is None else np.asarray(contact_ohm, dtype=float)
        blocks = list(self.blocks)
        for part in np.array_split(np.arange(len(element)), max(1, len(element) // 64)):
            fresh = self.sheet.condense(element[part], conductivity_s[part], contact)
            for one, block in zip(element[part], fresh, strict=True):
                blocks[one] = block
        for offset in self.sheet.branch(element):
            merge = self.sheet._merges[offset]
            blocks[self.sheet.elements + offset] = _merged(merge, blocks[merge.first], blocks[merge.second])
        return Factor(self.sheet, blocks, contact)


def _transfer(admittance: Array) -> Array:
    count = len(admittance)
    mean = np.full((count, count), 1.0 / count)
    scale = np.trace(admittance) / count
    return np.linalg.inv(admittance + scale * mean) - mean / scale
