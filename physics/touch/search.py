"""How many contacts, where, how hard: contacts are added one at a time for as long as the evidence grows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.physics.touch.posterior import (
    APART_M,
    NUISANCES,
    added_by,
    descended,
    linearised,
    log_evidence,
    refined,
)
from ertskin.physics.touch.table import ResponseTable, tangents_at

Array = NDArray[np.float64]

STARTS, STARTS_APART_M = 3, 12e-3
"""Places a search for one contact more begins from."""
SATISFIED = 1.5
"""Mean square in units of the noise: contacts that leave less need no other, those that leave more are looked for again
one by one."""
EXCHANGES = 3
IMPOSSIBLE = 1e12
SCAN_M = 6e-3
SCAN_FORCES = (0.06, 0.12, 0.25, 0.5, 0.8)
"""Shares of the largest force that a search begins from."""
BEYOND_DOUBT = 200.0
"""A contact whose force is this many times its standard deviation, squared, costs so much in the log evidence to leave
out that fewer contacts are out of question."""
LIGHTER = 0.05
"""A touch may be this much lighter than the lightest contact before a reading without contacts is a strange one."""
HOPELESS = 10.0
"""One contact more that promises to lower the misfit by less than this is not looked for: a contact known no better
than to 3 mm and 30 % costs 15 of it in the evidence."""
SLACK = 8.0
"""One contact more is still tried where the last one lost less than this much of the log evidence: two that are close
may only together be better than one."""


@dataclass(frozen=True, eq=False)
class Beliefs:
    """N readings' contacts, the most probable number of them; C slots, NaN where there is none.

    ``contact_m`` (N,C,2), ``force_n`` (N,C). ``covariance`` (N,C,3,3): of x, y (metre) and force (newton) of each.
    ``probability`` (N,C): that each is there. ``count_probability`` (N,C+1): of each number of contacts.
    ``misfit`` (N,): mean square of what is left, in units of the noise; about 1 where the skin is as it was calibrated.
    """

    contact_m: Array
    force_n: Array
    covariance: Array
    probability: Array
    count_probability: Array
    misfit: Array


@dataclass(frozen=True, eq=False)
class TouchPosterior:
    """Contacts from readings in the coordinates of ``table``, which are in units of the noise.

    ``spread`` (3,) and ``remainder``: what the response may err by (``ertskin.physics.touch.posterior``).
    ``error`` (3,): further standard deviations of x, y (metre) and, as a share of the response, along its slope by
    force: where a press hardly changes it any more, that is much force. ``temperature``: by
    how much the log evidence is too sure. ``most``: contacts looked for at most. ``exchanges``: rounds in which
    contacts that fit poorly are looked for anew; each may take a tenth of a second. ``widening``: of every covariance.
    """

    table: ResponseTable
    spread: Array
    remainder: float
    error: Array
    least_force_n: float
    temperature: float = 1.0
    most: int = 4
    exchanges: int = EXCHANGES
    widening: float = 1.0

    def __post_init__(self) -> None:
        grid = self.table.grid
        lattice = [np.linspace(a[0], a[-1], max(2, round((a[-1] - a[0]) / SCAN_M) + 1)) for a in (grid.x_m, grid.y_m)]
        forces = np.array(SCAN_FORCES) * grid.force_n[-1]
        x, y, force = (axis.ravel() for axis in np.meshgrid(*lattice, forces, indexing="ij"))
        place = np.column_stack([x, y, force])
        scanned = np.ascontiguousarray(self.table.alone(place[:, :2], force))
        table, (low, high) = self.table, self.bounds
        spline = table.knots_x, table.knots_y, table.knots_n, table.response
        object.__setattr__(self, "_model", (spline, table.compiled(), self.spread, self.remainder, low, high))
        lightest = np.ascontiguousarray(place[force == forces[0]])
        lightest[:, 2] = self.least_force_n
        light = np.ascontiguousarray(self.table.alone(lightest[:, :2], lightest[:, 2]))
        scan = place, scanned, (scanned**2).sum(axis=1), self.exchanges, lightest, light, (light**2).sum(axis=1)
        object.__setattr__(self, "_scan", scan)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(3,) least and (3,) largest x, y and force looked for."""
        grid = self.table.grid
        low = np.array([grid.x_m[0], grid.y_m[0], self.least_force_n])
        return low, np.array([grid.x_m[-1], grid.y_m[-1], grid.force_n[-1]])

    def of(self, readings: Array, proposed: Array | None = None) -> Beliefs:
        """Contacts of (N,D) readings; ``proposed`` (N,C,3) contacts to begin from, NaN for none, most likely first."""
        slots = self.most
        count = len(readings)
        starts = np.full((count, 0, 3), np.nan) if proposed is None else proposed
        touch = np.full((count, slots, 3), np.nan)
        covariance = np.full((count, slots, 3, 3), np.nan)
        logs = np.full((count, slots + 1), -np.inf)
        misfit = np.empty(count)
        for n, reading in enumerate(np.ascontiguousarray(readings, dtype=float)):
            begun = np.ascontiguousarray(starts[n], dtype=float)
            misfit[n] = searched(reading, begun, self._model, self._scan, touch[n], covariance[n], logs[n])  # type: ignore[attr-defined]
        share = np.exp((logs - logs.max(axis=1, keepdims=True)) / self.temperature)
        share /= share.sum(axis=1, keepdims=True)
        stated(touch.reshape(-1, 3), self._model[0], self.error, self.widening, covariance.reshape(-1, 3, 3))  # type: ignore[attr-defined]
        there = np.cumsum(share[:, ::-1], axis=1)[:, ::-1][:, 1:]
        probability = np.where(np.isfinite(touch[..., 2]), there, np.nan)
        return Beliefs(touch[..., :2], touch[..., 2], covariance, probability, share, misfit)

    def begun(self, reading: Array, proposed: Array, held: Array) -> Array:
        """(C,3) contacts to begin from in a reading (D,): those ``proposed`` (C,3), NaN for none, or ``held`` (n,3) of
        the scan before, where these aren't fewer and leave less of it as they are."""
        offered = np.ascontiguousarray(proposed[np.isfinite(proposed[:, 0])])
        if len(held) < len(offered):
            return proposed
        left, other = (unexplained(reading, each, self._model) for each in (held, offered))  # type: ignore[attr-defined]
        if left @ left >= other @ other:
            return proposed
        begun = np.full_like(proposed, np.nan)
        begun[: len(held)] = held
        return begun


@njit(cache=True, nogil=True)
def unexplained(reading, touch, model):  # type: ignore[no-untyped-def]
    """(D,) what contacts (C,3) leave of a reading (D,)."""
    if len(touch) == 0:
        return reading.copy()
    predicted, rows = np.empty(len(reading)), np.empty((2 * NUISANCES * len(touch), len(reading)))
    linearised(touch, model[0], added_by(touch, model[1], len(reading)), model[2], predicted, rows)
    return reading - predicted


@njit(cache=True, nogil=True)
def stated(touch, spline, error, widening, covariance):  # type: ignore[no-untyped-def]
    """Turn covariances (n,3,3) by log force, of the contacts (n,3) there are, into those by force, with ``error``."""
    rows = np.empty((7, spline[3].shape[3]))
    for c in range(len(touch)):
        force_n = touch[c, 2]
        if not np.isfinite(force_n):
            continue
        covariance[c, 2] *= force_n
        covariance[c, :, 2] *= force_n
        tangents_at(spline[0], spline[1], spline[2], spline[3], touch[c, 0], touch[c, 1], force_n, rows)
        # Newton that change the response by as much as it is.
        per_size_n = np.sqrt((rows[0] @ rows[0]) / (rows[3] @ rows[3]))
        for k in range(3):
            covariance[c, k, k] += (error[k] * (per_size_n if k == 2 else 1.0)) ** 2
        covariance[c] *= widening


@njit(cache=True, nogil=True)
def searched(reading, proposed, model, scan, touch, covariance, logs):  # type: ignore[no-untyped-def]
    """Fill the best contacts (C,3), covariances (C,3,3) and log evidences (C+1,) of one reading; its mean misfit."""
    width = len(reading)
    logs[0] = -0.5 * (reading @ reading)
    square = (reading @ reading) / width
    answer = _begun(reading, proposed, model)
    while True:
        count = len(answer[0])
        if count > 0:
            poor = answer[1] > SATISFIED * width or not possible(answer[0], model)
            if count > 1 and poor and square >= SATISFIED:
                answer = _exchanged(reading, answer, model, scan)
            if not possible(answer[0], model):
                break
            best = logs.max()
            logs[count] = log_evidence(*answer, model[4], model[5])  # type: ignore[call-arg]
            if logs[count] > best:
                square = _kept(answer, width, touch, covariance)
            elif logs[count] < best - SLACK:
                break
        if count == len(touch) or square < SATISFIED or not hopeful(reading, answer[0], model, scan):
            break
        answer = _extended(reading, answer[0], model, scan, STARTS)
    square = _fewer(reading, model, square, touch, covariance, logs)
    return square if np.isfinite(touch[0, 0]) else _lightest(reading, model, scan, square)


@njit(inline="always")
def _begun(reading, proposed, model):  # type: ignore[no-untyped-def]
    """The proposed contacts fitted together, the weakest left out for as long as they can't all be."""
    offered = 0
    while offered < len(proposed) and np.isfinite(proposed[offered, 0]):
        offered += 1
    now = proposed[:offered].copy()
    while len(now) > 0:
        answer = descended(reading, now, *model)
        if answer[1] > SATISFIED * len(reading):
            answer = refined(reading, now, *model)
        if possible(answer[0], model):
            return answer
        weakest = np.argmin(answer[0][:, 2])
        now = np.concatenate((answer[0][:weakest], answer[0][weakest + 1 :]))
    return now, reading @ reading, np.zeros((0, 0)), 0.0


@njit(inline="always")
def _kept(answer, width, touch, covariance):  # type: ignore[no-untyped-def]
    """Fill the contacts (C,3) and covariances (C,3,3) of the best answer so far; its mean misfit."""
    count = len(answer[0])
    touch[:], covariance[:] = np.nan, np.nan
    touch[:count] = answer[0]
    inverse = np.linalg.inv(answer[2] + 1e-9 * np.eye(3 * count))
    for c in range(count):
        covariance[c] = inverse[3 * c : 3 * c + 3, 3 * c : 3 * c + 3]
    return answer[1] / width


@njit(inline="always")
def _fewer(reading, model, square, touch, covariance, logs):  # type: ignore[no-untyped-def]
    """Weigh one contact less than the best, the one least sure left out, until that is out of question; the mean misfit
    of what is best then."""
    while True:
        count = 0
        while count < len(touch) and np.isfinite(touch[count, 0]):
            count += 1
        if count < 2 or np.isfinite(logs[count - 1]):
            return square
        doubtful = 0
        for c in range(count):
            if covariance[c, 2, 2] > covariance[doubtful, 2, 2]:
                doubtful = c
        if covariance[doubtful, 2, 2] < 1.0 / BEYOND_DOUBT:
            return square
        others = np.concatenate((touch[:doubtful], touch[doubtful + 1 : count]))
        answer = descended(reading, others, *model)
        if not possible(answer[0], model):
            return square
        logs[count - 1] = log_evidence(*answer, model[4], model[5])  # type: ignore[call-arg]
        if logs[count - 1] < logs[count]:
            return square
        square = _kept(answer, len(reading), touch, covariance)


@njit(inline="always")
def _lightest(reading, model, scan, square):  # type: ignore[no-untyped-def]
    """Mean misfit of a reading without contacts, or with one that is lighter than they can be."""
    if square < SATISFIED:
        return square
    spline, cells, spread, remainder, low, high = model
    lighter = low.copy()
    lighter[2] *= LIGHTER
    place = next_contacts(reading, np.empty((0, 3)), model, scan, 1)
    place[0, 2] = low[2]
    return min(square, descended(reading, place, spline, cells, spread, remainder, lighter, high)[1] / len(reading))


@njit(cache=True, nogil=True)
def hopeful(reading, now, model, scan):  # type: ignore[no-untyped-def]
    """Whether one contact more, as light as they can be or stronger, may lower the misfit by as much as its place and
    force cost in the evidence, those there are (C,3) following as straight as they look."""
    count, width = len(now), len(reading)
    if count == 0:
        return True
    places, responses, squares = scan[4:]
    predicted, rows = np.empty(width), np.empty((2 * NUISANCES * count, width))
    linearised(now, model[0], added_by(now, model[1], width), model[2], predicted, rows)
    left = reading - predicted
    variance = 1.0 + model[3] ** 2 * (predicted @ predicted) / width
    products = rows @ rows.T
    for k in range(len(rows)):
        products[k, k] += variance if k < NUISANCES * count else 1e-9 * products[k, k] + 1e-12
    seen = responses @ rows.T
    taken = np.linalg.solve(products, np.ascontiguousarray(seen.T))
    by_left = (responses @ left - (rows @ left) @ taken) / variance
    for k in range(len(places)):
        own = (squares[k] - seen[k] @ taken[:, k]) / variance
        share = max(by_left[k] / own, 1.0)
        if 2.0 * share * by_left[k] - share**2 * own > HOPELESS:
            return True
    return False


@njit(inline="always")
def _extended(reading, now, model, scan, starts):  # type: ignore[no-untyped-def]
    """``refined`` of the contacts ``now`` with the one more that fits best, of so many ``starts``."""
    tried = next_contacts(reading, now, model, scan, starts)
    best = refined(reading, _with(now, tried[0]), *model)
    for k in range(1, len(tried)):
        if best[1] < SATISFIED * len(reading) and possible(best[0], model):
            break
        other = refined(reading, _with(now, tried[k]), *model)
        if _cost(other, model) < _cost(best, model):
            best = other
    return best


@njit(inline="always")
def _exchanged(reading, answer, model, scan):  # type: ignore[no-untyped-def]
    """Each contact in turn taken away and looked for anew, for as long as that fits better."""
    best = answer
    for _ in range(scan[3]):
        better = False
        for c in range(len(answer[0])):
            others = np.concatenate((best[0][:c], best[0][c + 1 :]))
            alone = refined(reading, others, *model)[0]
            other = _extended(reading, alone, model, scan, 2 * STARTS)
            if _cost(other, model) < _cost(best, model) - 1.0:
                best, better = other, True
        if not better:
            break
    return best


@njit(cache=True, nogil=True)
def _with(now, contact):  # type: ignore[no-untyped-def]
    more = np.empty((len(now) + 1, 3))
    more[: len(now)] = now
    more[len(now)] = contact
    return more


@njit(cache=True, nogil=True)
def next_contacts(reading, now, model, scan, starts):  # type: ignore[no-untyped-def]
    """(n,3) of the scan, apart from one another: the contacts that beside those ``now`` leave least, best first."""
    places, responses, squares = scan[:3]
    remains = squares - 2.0 * (responses @ unexplained(reading, now, model))
    chosen = np.empty((starts, 3))
    for n in range(starts):
        best = 0
        for k in range(len(places)):
            free = True
            for c in range(len(now)):
                free &= _apart(now[c], places[k], APART_M)
            for c in range(n):
                free &= _apart(chosen[c], places[k], STARTS_APART_M)
            if not free:
                remains[k] = np.inf
            elif remains[k] < remains[best]:
                best = k
        chosen[n] = places[best]
    return chosen


@njit(cache=True, nogil=True)
def _apart(one, other, least_m):  # type: ignore[no-untyped-def]
    return (one[0] - other[0]) ** 2 + (one[1] - other[1]) ** 2 >= least_m**2


@njit(cache=True, nogil=True)
def _cost(answer, model):  # type: ignore[no-untyped-def]
    """What ``refined`` minimises, far above anything possible for contacts that can't be."""
    return answer[1] + answer[3] if possible(answer[0], model) else IMPOSSIBLE + answer[1]


@njit(cache=True, nogil=True)
def possible(touch, model):  # type: ignore[no-untyped-def]
    """Whether all of the contacts (C,3) press, and none lies nearer to another than contacts can."""
    if touch[:, 2].min() <= model[4][2]:
        return False
    for a in range(len(touch)):
        for b in range(a):
            if not _apart(touch[a], touch[b], APART_M):
                return False
    return True
