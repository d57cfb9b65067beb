"""Where a search for one contact more begins, and whether there is any hope for one."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.physics.touch.posterior import APART_M, Fit
from ertskin.physics.touch.table import ResponseTable, all_tangents, dot

Array = NDArray[np.float64]

STARTS_APART_M = 12e-3
"""Places a search begins from are at least so far apart."""
LEAST_PARTED_M, MOST_PARTED_M = 0.6 * APART_M, 15e-3
"""Two contacts taken for one lie so far to its sides."""
FEW = 16
"""Every sixteenth place tells first whether another contact is hopeful."""
SCAN_M = 6e-3
SCAN_FORCES = (0.06, 0.12, 0.25, 0.5, 0.8)
"""Shares of the largest force that a search begins from."""
HOPELESS = 10.0
"""One contact more that promises to lower the misfit by less than this is not looked for: a contact known no better
than to 3 mm and 30 % costs 15 of it in the evidence."""
NEARBY = 1e-3
"""Share of a contact's response that is taken for its own at least, in single precision."""


class Starts:
    """What a search for one contact more begins from: ``place`` (n,2) by ``force`` (m,) and ``response`` (n,m,D), in
    single precision, and the responses ``light`` (n,D) to the lightest contacts there can be; the sums of their
    squares, and an ``order`` (n,) of the places."""

    def __init__(self, table: ResponseTable, force_n: Array, least_n: float) -> None:
        grid = table.grid
        self.spline = table.knots_x, table.knots_y, table.knots_n, table.response
        self.bounds = tuple(np.array([some[k] for some in (grid.x_m, grid.y_m)], dtype=float) for k in (0, -1))
        x, y = (np.linspace(a[0], a[-1], max(2, round((a[-1] - a[0]) / SCAN_M) + 1)) for a in (grid.x_m, grid.y_m))
        self.place, self.force = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2), force_n
        response = table.alone(np.repeat(self.place, len(force_n), axis=0), np.tile(force_n, len(self.place)))
        self.light = np.ascontiguousarray(table.alone(self.place, np.full(len(self.place), least_n)))
        self.response = response.astype(np.float32).reshape(len(self.place), len(force_n), -1)
        self.squares = (response**2).sum(axis=1).reshape(len(self.place), -1)
        self.light_squares = (self.light**2).sum(axis=1)
        # Few places first, all over the sheet: where much is left, any of them tells it.
        self.order = np.concatenate([np.arange(k, len(self.place), FEW) for k in range(FEW)])
        self.light = self.light.astype(np.float32)

    def with_one_more(self, left: Array, now: Array, count: int) -> list[Array]:
        """Contacts (C+1,3) a search for one more than ``now`` (C,3), which leave (D,), begins from; so many, the
        most promising first: one of the places and forces beside them, or one of them parted in two."""
        contact, gain = _nearest(
            left.astype(np.float32), now, self.place, self.force, self.response, self.squares, count
        )
        found = [np.vstack([now, each]) for each in contact]
        if len(now):
            parted, more = _parted(left, now, *self.spline, *self.bounds)
            if more > 0.0:
                found.insert(int((gain > more).sum()), parted)
        return found[:count]

    def hopeful(self, fit: Fit) -> bool:
        """Whether one contact more, as light as they can be or stronger, may lower the misfit by as much as its place
        and force cost in the evidence, those there are following as straight as they look."""
        across = _across(fit.rows, fit.variance).astype(np.float32)
        return bool(_promises(across, fit.variance, self.light, self.light_squares, self.order))


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _single_dot(one, other):  # type: ignore[no-untyped-def]
    """``dot`` of numbers in single precision, summed in that."""
    total = np.float32(0.0)
    for d in range(len(one)):
        total += one[d] * other[d]
    return total


@njit(cache=True, nogil=True)
def _nearest(left, now, place, force, response, squares, starts):  # type: ignore[no-untyped-def]
    """(n,3) of the places and forces, ``starts`` of them at most, apart from one another and from the contacts ``now``
    (C,3): those that leave least of what these leave (D,), best first; by how much less."""
    count, best = len(place), np.empty(len(place), dtype=np.int64)
    least, found, gain = np.full(count, np.inf), np.empty((starts, 3)), np.empty(starts)
    for p in range(count):
        for f in range(len(force)):
            remains = squares[p, f] - 2.0 * _single_dot(response[p, f], left)
            if remains < least[p]:
                least[p], best[p] = remains, f
        for c in range(len(now)):
            if (place[p, 0] - now[c, 0]) ** 2 + (place[p, 1] - now[c, 1]) ** 2 < APART_M**2:
                least[p] = np.inf
    for n in range(starts):
        first = np.argmin(least)
        if n > 0 and not np.isfinite(least[first]):
            return found[:n], gain[:n]
        gain[n] = -least[first]
        found[n, 0], found[n, 1], found[n, 2] = place[first, 0], place[first, 1], force[best[first]]
        for p in range(count):
            if (place[p, 0] - place[first, 0]) ** 2 + (place[p, 1] - place[first, 1]) ** 2 < STARTS_APART_M**2:
                least[p] = np.inf
    return found, gain


@njit(cache=True, nogil=True, error_model="numpy")
def _parted(left, now, knots_x, knots_y, knots_n, response, low, high):  # type: ignore[no-untyped-def]
    """Contacts ``now`` (C,3) with one of them parted in two (C+1,3), and by how much less they leave of what they leave
    (D,): that one whose second derivatives, across the slopes of all, are most like it."""
    tangents = np.empty((len(now), 7, len(left)))
    all_tangents(knots_x, knots_y, knots_n, response, now, tangents)
    slopes, free = _slopes(tangents), left.copy()
    _leave_out(free, slopes)
    parted, most = np.empty((len(now) + 1, 3)), 0.0
    for c in range(len(now)):
        shapes, products, seen = tangents[c, 4:7], np.empty((3, 3)), np.empty(3)
        for i in range(3):
            _leave_out(shapes[i], slopes)
            seen[i] = dot(shapes[i], free)
            for j in range(i + 1):
                products[i, j] = products[j, i] = dot(shapes[i], shapes[j])
            products[i, i] = (1.0 + 1e-9) * products[i, i] + 1e-12
        along = np.linalg.solve(products, seen)
        gain = dot(along, seen)
        if gain > most and _twice(now, c, along, low, high, parted):
            most = gain
    return parted, most


@njit(cache=True, nogil=True)
def _twice(now, c, along, low, high, parted):  # type: ignore[no-untyped-def]
    """Fill ``parted`` (C+1,3) with contacts ``now`` (C,3), the one ``c`` as two of half the force; whether it can be.

    Two such contacts, each so far ``away`` from the middle, read as one in the middle and half its second derivative
    along their line times the square of ``away``: of second derivatives ``along`` (3,) by xx, yy and xy that is one
    eigenvalue, and the other nought.
    """
    half, across = 0.5 * (along[0] - along[1]), 0.5 * along[2]
    bend = 0.5 * (along[0] + along[1]) + np.hypot(half, across)
    if bend <= 0.0:
        return False
    away, angle = min(max(np.sqrt(2.0 * bend), LEAST_PARTED_M), MOST_PARTED_M), 0.5 * np.arctan2(across, half)
    last = len(now)
    parted[:last] = now
    parted[last] = now[c]
    parted[c, 2] = parted[last, 2] = 0.5 * now[c, 2]
    for k in range(2):
        step = away * (np.cos(angle) if k == 0 else np.sin(angle))
        parted[c, k] = min(max(now[c, k] + step, low[k]), high[k])
        parted[last, k] = min(max(now[c, k] - step, low[k]), high[k])
    return True


@njit(cache=True, nogil=True)
def _slopes(tangents):  # type: ignore[no-untyped-def]
    """(n,D) orthonormal directions of the slopes by place and force of ``tangents`` (C,7,D)."""
    slopes, known = np.empty((3 * len(tangents), tangents.shape[2])), 0
    for c in range(len(tangents)):
        for k in range(1, 4):
            slopes[known] = tangents[c, k]
            size = dot(slopes[known], slopes[known])
            _leave_out(slopes[known], slopes[:known])
            rest = dot(slopes[known], slopes[known])
            if rest > NEARBY**2 * size:
                slopes[known] /= np.sqrt(rest)
                known += 1
    return slopes[:known]


@njit(cache=True, nogil=True)
def _leave_out(row, directions):  # type: ignore[no-untyped-def]
    """Take from ``row`` (D,), in place, its part along orthonormal ``directions`` (n,D)."""
    for k in range(len(directions)):
        share = dot(row, directions[k])
        for d in range(len(row)):
            row[d] -= share * directions[k, d]


@njit(cache=True, nogil=True, error_model="numpy")
def _across(rows, variance):  # type: ignore[no-untyped-def]
    """(2n+1,D) orthonormal directions that contacts and errors of a fit with these ``rows`` can follow, its errors with
    a part of what they are allowed by the noise's ``variance`` (Cholesky), and what is left then."""
    count, free = len(rows), rows.copy()
    products = np.empty((count, count))
    for i in range(count):
        for j in range(i):
            products[i, j] = dot(rows[i], rows[j])
    for i in range(count - 1):
        square = dot(rows[i], rows[i])
        square += variance if i < count // 2 else 1e-9 * square + 1e-12
        for k in range(i):
            share = products[i, k]
            for j in range(k):
                share -= products[i, j] * products[k, j]
            share /= products[k, k]
            products[i, k] = share
            square -= share * share
            for d in range(rows.shape[1]):
                free[i, d] -= share * free[k, d]
        products[i, i] = np.sqrt(square)
        for d in range(rows.shape[1]):
            free[i, d] /= products[i, i]
    for k in range(count - 1):
        share = dot(free[k], rows[count - 1])
        for d in range(rows.shape[1]):
            free[count - 1, d] -= share * free[k, d]
    return free


@njit(cache=True, nogil=True)
def _promises(across, variance, light, squares, order):  # type: ignore[no-untyped-def]
    """Whether one of the ``light`` contacts (n,D), or a stronger one in its place, promises to lower the misfit by
    ``HOPELESS``, given ``_across`` of the contacts there are."""
    last = len(across) - 1
    for p in order:
        own = squares[p]
        for k in range(last):
            own -= _single_dot(across[k], light[p]) ** 2
        own = max(own, NEARBY * squares[p]) / variance
        by_left = _single_dot(light[p], across[last]) / variance
        share = max(by_left / own, 1.0)
        if share * (2.0 * by_left - share * own) > HOPELESS:
            return True
    return False
