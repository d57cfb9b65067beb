"""The skin's response to a touch anywhere, tabulated over place and force: a forward model that costs microseconds.

What one contact does is a smooth function of its place and force. It is solved on a grid of places, at some forces, and
interpolated by cubic splines; what several contacts add together comes from ``ertskin.physics.touch.interplay``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.physics.touch.interplay import Interplay, interplay_ohm
from ertskin.physics.touch.spline import basis, coefficients, evaluated

Array = NDArray[np.float64]
Floats = NDArray[np.floating]

TANGENTS = 7
"""Rows of ``tangents``: the response, its slopes by x, y and force, its second derivatives by xx, yy and xy."""
DENSER_WHERE_LIGHT = 2.0
"""Power of the spacing of forces. With eight of them, at five places of `rig_a`, splines miss the solved response by
0.07 % at most from 0.2 N on; evenly spaced in the power 1.5 it was 1.7 % at 0.2 N and 0.4 % at 0.6 N."""
LEAST_CELL = 0.01
"""A cell whose conductance changes by less than this share of the most pressed one's has no part in the interplay."""


def force_nodes(count: int, most_n: float) -> Array:
    """(count,) forces up to ``most_n`` newton, 0 left out."""
    return np.asarray(most_n * (np.arange(1, count + 1) / count) ** DENSER_WHERE_LIGHT)


@dataclass(frozen=True, eq=False)
class TouchGrid:
    """Where a table is solved: places ``x_m`` (X,) by ``y_m`` (Y,), forces ``force_n`` (F,) without 0."""

    x_m: Array
    y_m: Array
    force_n: Array

    @classmethod
    def over(cls, extent_m: Array, spacing_m: float, forces: int, max_force_n: float) -> TouchGrid:
        """The whole sheet [low, high] = ``extent_m`` (2,2) at ``spacing_m`` at most; forces denser where light."""
        low, high = extent_m
        count = np.maximum(4, np.ceil((high - low) / spacing_m - 1e-6).astype(int) + 1)
        x, y = (np.linspace(low[k], high[k], count[k]) for k in range(2))
        return cls(x, y, force_nodes(forces, max_force_n))

    @property
    def shape(self) -> tuple[int, int, int]:
        """(X, Y, F)."""
        return len(self.x_m), len(self.y_m), len(self.force_n)

    def presses(self) -> tuple[Array, Array]:
        """(X*Y*F,1,2) places and (X*Y*F,1) forces, all forces of a place in a row."""
        x, y, force = (axis.ravel() for axis in np.meshgrid(self.x_m, self.y_m, self.force_n, indexing="ij"))
        return np.stack([x, y], axis=1)[:, None], force[:, None]


@dataclass(frozen=True, eq=False)
class ResponseTable:
    """Spline coefficients of the response in D coordinates and of C cells' change of conductance.

    ``response`` (X,Y,F+1,D) and ``cell_s`` (X,Y,F+1,C), float32; ``knots_*`` of the splines by x, y (metre) and force
    (newton); ``read`` (P,D): pair resistances in ohm to the D coordinates.
    """

    grid: TouchGrid
    knots_x: Array
    knots_y: Array
    knots_n: Array
    response: Floats
    cell_s: Floats
    interplay: Interplay
    read: Array

    def __post_init__(self) -> None:
        """In one type and layout whatever they came from, or numba compiles anew what takes them."""
        for name in ("knots_x", "knots_y", "knots_n", "read"):
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), dtype=float))
        for name in ("response", "cell_s"):
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), dtype=np.float32))

    @classmethod
    def through(cls, grid: TouchGrid, change_ohm: Array, cell_s: Array, interplay: Interplay) -> ResponseTable:
        """From changes at ``grid.presses``: (X*Y*F,P) of pair resistances, (X*Y*F,C) of the cells' conductance."""
        read = np.eye(change_ohm.shape[1])
        response, knots = _splined(grid, change_ohm)
        cells, _ = _splined(grid, cell_s)
        return cls(grid, *knots, response.astype(np.float32), cells.astype(np.float32), interplay, read)

    def seen(self, matrix: Array) -> ResponseTable:
        """The same table in other coordinates: old ones (D,) times ``matrix`` (D,E)."""
        response = np.ascontiguousarray(self.response @ matrix.astype(np.float32))
        return replace(self, response=response, read=np.ascontiguousarray(self.read @ matrix))

    def with_forces(self, factor: int) -> ResponseTable:
        """The same splines on ``factor`` times as many forces, for what is added there."""
        grid = replace(self.grid, force_n=force_nodes(factor * len(self.grid.force_n), self.grid.force_n[-1]))
        nodes = np.concatenate([[0.0], grid.force_n])
        knots, response = coefficients(nodes, evaluated(self.knots_n, self.response, nodes, 2), 2)
        _, cell_s = coefficients(nodes, evaluated(self.knots_n, self.cell_s, nodes, 2), 2)
        return replace(self, grid=grid, knots_n=knots, response=_single(response), cell_s=_single(cell_s))

    def corrected(self, added: Array) -> ResponseTable:
        """With (X*Y*F,D) added at ``grid.presses``."""
        more, _ = _splined(self.grid, added)
        return replace(self, response=(self.response + more).astype(np.float32))

    def alone(self, contact_m: Array, force_n: Array) -> Array:
        """(N,D) responses to single contacts at (N,2) with (N,) newton."""
        return self.tangents(contact_m, force_n)[:, 0]

    def tangents(self, contact_m: Array, force_n: Array) -> Array:
        """(N,7,D) responses and their derivatives by x, y, force, xx, yy, xy for single contacts (N,2), (N,)."""
        out = np.empty((len(force_n), TANGENTS, self.response.shape[3]))
        places = np.ascontiguousarray(np.column_stack([contact_m, force_n]), dtype=float)
        all_tangents(self.knots_x, self.knots_y, self.knots_n, self.response, places, out)
        return out

    def change(self, contact_m: Array, force_n: Array) -> Array:
        """(N,D) responses to contacts (N,C,2) with forces (N,C), NaN for an absent one."""
        present = np.isfinite(contact_m).all(axis=-1) & (np.nan_to_num(force_n) > 0)
        rows, slots = np.nonzero(present)
        total = np.zeros((len(force_n), self.response.shape[3]))
        if len(rows):
            np.add.at(total, rows, self.alone(contact_m[rows, slots], force_n[rows, slots]))
        touches = np.concatenate([np.nan_to_num(contact_m), np.nan_to_num(force_n)[..., None]], axis=-1)
        several = np.flatnonzero(present.sum(axis=1) > 1)
        if len(several):
            all_together(np.ascontiguousarray(touches), present, several, self.compiled(), total)
        return total

    def compiled(self) -> tuple[Any, ...]:
        """The arrays ``added_together`` and the posterior's compiled loops take."""
        inter = self.interplay
        cells = self.knots_x, self.knots_y, self.knots_n, self.cell_s, inter.center_m, self.reach_m
        # Fetching them is what takes long, and what they tell is a hundredth of a response.
        return *cells, _single(inter.field), _single(inter.green), inter.area_m2, _single(self.read)

    @property
    def reach_m(self) -> float:
        """Cells further than this from a contact aren't looked at: three of the interplay's cells."""
        return 3.0 * float(np.sqrt(self.interplay.area_m2.max()))


def _single(values: Array) -> Floats:
    return np.ascontiguousarray(values, dtype=np.float32)


def _splined(grid: TouchGrid, values: Array) -> tuple[Array, tuple[Array, Array, Array]]:
    """Coefficients and knots of the splines through (X*Y*F,D) values, and through 0 where there is no force."""
    shaped = values.reshape(*grid.shape, -1)
    with_rest = np.concatenate([np.zeros_like(shaped[:, :, :1]), shaped], axis=2)
    knots_n, made = coefficients(np.concatenate([[0.0], grid.force_n]), with_rest, 2)
    knots_x, made = coefficients(grid.x_m, made, 0)
    knots_y, made = coefficients(grid.y_m, made, 1)
    return np.ascontiguousarray(made), (knots_x, knots_y, knots_n)


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def dot(one, other):  # type: ignore[no-untyped-def]
    """Sum of products, in whatever order is fastest."""
    total = 0.0
    for d in range(len(one)):
        total += one[d] * other[d]
    return total


@njit(cache=True, nogil=True)
def tangents_at(knots_x, knots_y, knots_n, response, x, y, force, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` (7,D) with a single contact's response and its derivatives: summed over forces, then y, then x."""
    bx, by, bf = np.empty((3, 4)), np.empty((3, 4)), np.empty((3, 4))
    i, j, k = basis(knots_x, x, bx), basis(knots_y, y, by), basis(knots_n, force, bf)
    along = np.empty((4, out.shape[1]))
    out[:] = 0.0
    for a in range(4):
        along[:] = 0.0
        for b in range(4):
            _over_forces(response[i + a, j + b, k : k + 4], bf, by[:, b], along)
        value, by_y, by_yy, by_force = along[0], along[1], along[2], along[3]
        x0, x1, x2 = bx[0, a], bx[1, a], bx[2, a]
        for d in range(len(value)):
            out[0, d] += x0 * value[d]
            out[1, d] += x1 * value[d]
            out[2, d] += x0 * by_y[d]
            out[3, d] += x0 * by_force[d]
            out[4, d] += x2 * value[d]
            out[5, d] += x0 * by_yy[d]
            out[6, d] += x1 * by_y[d]


@njit(inline="always")
def _over_forces(rows, bf, by, along):  # type: ignore[no-untyped-def]
    """Add to ``along`` (4,D) one place's part in the response, its slope and second derivative by y, its slope by
    force."""
    r0, r1, r2, r3 = rows[0], rows[1], rows[2], rows[3]
    f0, f1, f2, f3 = bf[0, 0], bf[0, 1], bf[0, 2], bf[0, 3]
    g0, g1, g2, g3 = bf[1, 0], bf[1, 1], bf[1, 2], bf[1, 3]
    y0, y1, y2 = by[0], by[1], by[2]
    a0, a1, a2, a3 = along[0], along[1], along[2], along[3]
    for d in range(len(a0)):
        value = f0 * r0[d] + f1 * r1[d] + f2 * r2[d] + f3 * r3[d]
        a0[d] += y0 * value
        a1[d] += y1 * value
        a2[d] += y2 * value
        a3[d] += y0 * (g0 * r0[d] + g1 * r1[d] + g2 * r2[d] + g3 * r3[d])


@njit(cache=True, nogil=True)
def all_tangents(knots_x, knots_y, knots_n, response, touch, out):  # type: ignore[no-untyped-def]
    """``tangents_at`` for contacts (N,3) into ``out`` (N,7,D)."""
    for n in range(len(touch)):
        tangents_at(knots_x, knots_y, knots_n, response, touch[n, 0], touch[n, 1], touch[n, 2], out[n])


@njit(cache=True, nogil=True)
def added_together(touch, knots_x, knots_y, knots_n, cell_s, center_m, reach_m, field, green, area_m2, read):  # type: ignore[no-untyped-def]
    """(D,) what contacts (C,3) add to the sum of what each does alone."""
    cells = np.empty(len(touch) * len(center_m), dtype=np.int64)
    change, begin = np.empty(len(cells)), np.zeros(len(touch) + 1, dtype=np.int64)
    for c in range(len(touch)):
        begin[c + 1] = _pressed_cells(
            touch[c], begin[c], cells, change, knots_x, knots_y, knots_n, cell_s, center_m, reach_m
        )
    transfer = interplay_ohm(field, green, area_m2, cells, change, begin)
    electrodes = len(transfer)
    total = np.zeros(read.shape[1])
    pair = 0
    for i in range(electrodes):
        for j in range(i + 1, electrodes):
            value = transfer[i, i] + transfer[j, j] - transfer[i, j] - transfer[j, i]
            for d in range(len(total)):
                total[d] += value * read[pair, d]
            pair += 1
    return total


@njit(cache=True, nogil=True)
def all_together(touch, present, rows, cells, total):  # type: ignore[no-untyped-def]
    """Add to ``total`` (N,D) what the contacts (N,C,3) that are ``present`` add together, in the frames ``rows``."""
    for row in rows:
        some, count = np.empty((touch.shape[1], 3)), 0
        for c in range(touch.shape[1]):
            if present[row, c]:
                for k in range(3):
                    some[count, k] = touch[row, c, k]
                count += 1
        added = added_together(some[:count], *cells)
        for d in range(len(added)):
            total[row, d] += added[d]


@njit(inline="always")
def _pressed_cells(touch, first, cells, change, knots_x, knots_y, knots_n, cell_s, center_m, reach_m):  # type: ignore[no-untyped-def]
    """Append the cells a contact presses from place ``first`` on; where the next contact's begin."""
    bx, by, bf = np.empty((3, 4)), np.empty((3, 4)), np.empty((3, 4))
    i, j, k = basis(knots_x, touch[0], bx), basis(knots_y, touch[1], by), basis(knots_n, touch[2], bf)
    n = first
    for cell in range(len(center_m)):
        if (center_m[cell, 0] - touch[0]) ** 2 + (center_m[cell, 1] - touch[1]) ** 2 <= reach_m**2:
            cells[n], change[n] = cell, 0.0
            n += 1
    for a in range(4):
        for b in range(4):
            for c in range(4):
                weight, row = bx[0, a] * by[0, b] * bf[0, c], cell_s[i + a, j + b, k + c]
                for m in range(first, n):
                    change[m] += weight * row[cells[m]]
    largest = 0.0
    for m in range(first, n):
        largest = max(largest, abs(change[m]))
    kept = first
    for m in range(first, n):
        if abs(change[m]) > LEAST_CELL * largest:
            cells[kept], change[kept] = cells[m], change[m]
            kept += 1
    return kept
