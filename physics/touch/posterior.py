"""Where and how hard a skin is touched, most probably, and how sure that is (Laplace's method).

A reading z in units of the noise, D coordinates, under contacts theta = (x, y, force)_c:

    z = sum_c s(theta_c) + what they add together + sum_c N(theta_c) a_c + noise,      a ~ N(0, 1).

N holds what the tabulated response may err by: its shape (second derivatives: wider, longer, turned), across its
slopes, in standard deviations measured on the calibration's own presses; errors along the slopes are errors of place
and force and added to those. What is left of the error counts as noise that grows with the response. Integrated over a,
theta is found by Gauss-Newton (Levenberg 1944, Marquardt 1963), and the number of contacts by the evidence: likelihood
times prior times the posterior's volume (MacKay, Neural Computation 4 (1992) 415).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pi
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.physics.touch.table import added_together, dot, tangents_at

Array = NDArray[np.float64]

SHAPE_M = 5e-3
"""Length in which second derivatives are counted."""
NUISANCES = 3
STEPS = 20
DAMPING = 1e-3
MOST_STEP_M = 6e-3
COARSE, COARSE_SPREAD = 0.1, 0.5
CONVERGED = 1e-3
"""A step that gains less than this in the misfit is the last, and one that gains nothing and promised less."""
ROUGHLY, ROUGH_SHARE = 0.1, 0.02
"""The same where only the valley is looked for, and the share of the misfit that adds to it."""
UNWANTED = 0.1
"""A step that promises less than this share of what the last may gain isn't taken."""
MOVED_M, MOVED_SHARE = 1e-3, 0.1
SETTLED = 0.03
"""What contacts add together is found anew once one has moved this far or its force by that share; at the end, of
these, by so much: it changes slowly, and costs more than all the rest."""
APART_M = 8e-3
"""Two contacts nearer than this are one."""
LEAST_CURVATURE = 1e-9


@dataclass(frozen=True, eq=False, slots=True)
class Fit:
    """Contacts ``touch`` (C,3) fitted to a reading: places in metre, forces in newton.

    ``misfit`` and its ``curvature`` (3C,3C) by x, y and log force; ``logarithm`` of the covariance's determinant, the
    noise's ``variance``. ``rows`` (6C+1,D): possible errors, slopes and, last, what is left of the reading.
    ``added`` (D,): what contacts ``known`` (C,3), which are near these, add together. ``settled``: whether no further
    step would gain anything.
    """

    touch: Array
    misfit: float
    logarithm: float
    variance: float
    curvature: Array
    rows: Array
    known: Array
    added: Array
    settled: bool

    @property
    def left(self) -> Array:
        """(D,) of the reading."""
        return np.asarray(self.rows[-1])


def fitted(
    reading: Array, start: Array, model: tuple[Any, ...], before: Fit | None = None, *, steps: int = STEPS
) -> Fit:
    """Most probable contacts near ``start`` (C,3), C > 0, so many ``steps`` away at most; ``before``: as many fitted
    near there.

    ``model``: the response's spline, the cells of ``added_together``, ``spread``, ``remainder`` (rms of the response's
    error outside ``spread``, as a share of the response), least and largest place and force, (3,) each.
    """
    known = np.full_like(start, np.inf) if before is None else before.known
    added = np.zeros_like(reading) if before is None else before.added
    return Fit(*descended(reading, start, known, added, steps, CONVERGED, 0.0, *model))


def refined(reading: Array, start: Array, model: tuple[Any, ...]) -> Fit:
    """``fitted``, first as if the response erred by ``COARSE``, then as it is."""
    return fitted(reading, roughly(reading, start, model).touch, model)


def roughly(reading: Array, start: Array, model: tuple[Any, ...]) -> Fit:
    """``fitted`` as if the response erred by ``COARSE``, which smooths the misfit; what contacts add together is less
    than that, and left out."""
    spline, cells, spread, remainder, low, high = model
    smoothed = spline, cells, COARSE_SPREAD * spread, max(COARSE, remainder), low, high
    return Fit(
        *descended(reading, start, np.empty((0, 3)), np.zeros_like(reading), STEPS, ROUGHLY, ROUGH_SHARE, *smoothed)
    )


# Numba compiles a function again with each one that calls it: what has a single caller is written into that one.
@njit(cache=True, nogil=True, error_model="numpy")
def descended(reading, start, known, added, steps, least, share, spline, cells, spread, remainder, low, high):  # type: ignore[no-untyped-def]
    """The numbers of ``fitted``, the last step gaining less than ``least`` and that ``share`` of the misfit; with none
    ``known`` what they add together stays ``added``."""
    touch, tried, several = start.copy(), start.copy(), len(known) > 1
    rows = np.empty((2 * NUISANCES * len(start) + 1, len(reading)))
    spare, products = np.empty_like(rows), np.empty((len(rows), len(rows)))
    gradient, curvature = np.empty(3 * len(start)), np.empty((3 * len(start), 3 * len(start)))
    misfit, logarithm, variance, promised, damping = 0.0, 0.0, 1.0, 0.0, DAMPING
    anew = True
    while True:
        if anew and several and _moved(tried, known) > SETTLED:
            known, added = tried.copy(), added_together(tried, *cells)
        also = _compared(reading, tried, spline, added, spread, remainder, spare)
        other, larger = _weighed(spare, also, products)
        gained = misfit + logarithm - other - larger
        better = anew or gained > 0.0
        converged = least + share * other
        settled = not anew and (gained if better else promised) < converged
        if not anew:
            damping = max(0.1 * damping, 1e-9) if better else 10.0 * damping
        if better:
            touch, tried, rows, spare = tried, touch, spare, rows
            misfit, logarithm, variance = other, larger, also
            _keep(products, gradient, curvature)
        if not settled and steps > 0:
            promised = _stepped(touch, gradient, curvature, damping, low, high, tried)
            settled = better and (1.0 + damping) * promised < UNWANTED * converged
        anew = several and (better or settled) and _moved(touch, known) > (SETTLED if settled else 1.0)
        if anew:
            for c in range(len(touch)):
                for k in range(3):
                    tried[c, k] = touch[c, k]
        elif settled or damping > 1e6 or steps == 0:
            return touch, misfit, logarithm, variance, curvature, rows, known, added, settled or damping > 1e6
        else:
            steps -= 1


@njit(inline="always")
def _compared(reading, touch, spline, added, spread, remainder, rows):  # type: ignore[no-untyped-def]
    """Fill ``rows`` (6C+1,D) for contacts (C,3) that add ``added`` (D,) together: first the possible errors of all
    contacts, three each, then their slopes by x, y and log force, then the residual. The variance of the noise with
    ``remainder``."""
    tangents, predicted, slopes = np.empty((7, len(reading))), added.copy(), NUISANCES * len(touch)
    for c in range(len(touch)):
        force_n = touch[c, 2]
        tangents_at(spline[0], spline[1], spline[2], spline[3], touch[c, 0], touch[c, 1], force_n, tangents)
        for d in range(len(reading)):
            predicted[d] += tangents[0, d]
            rows[slopes + 3 * c, d] = tangents[1, d]
            rows[slopes + 3 * c + 1, d] = tangents[2, d]
            rows[slopes + 3 * c + 2, d] = force_n * tangents[3, d]
        _across(tangents)
        for k in range(NUISANCES):
            for d in range(len(reading)):
                rows[NUISANCES * c + k, d] = spread[k] * SHAPE_M**2 * tangents[4 + k, d]
    last = len(rows) - 1
    for d in range(len(reading)):
        rows[last, d] = reading[d] - predicted[d]
    return 1.0 + remainder**2 * dot(predicted, predicted) / len(reading)


@njit(inline="always")
def _across(rows):  # type: ignore[no-untyped-def]
    """Leave of each of the ``TANGENTS`` (7,D) from force and place on what lies across those before (Gram-Schmidt)."""
    order = (3, 1, 2, 4, 5, 6)
    for k in range(1, len(order)):
        row = rows[order[k]]
        for before in range(k):
            one = rows[order[before]]
            square = dot(one, one)
            if square > 0.0:
                share = dot(row, one) / square
                for d in range(len(row)):
                    row[d] -= share * one[d]


@njit(cache=True, nogil=True)
def _moved(touch, before):  # type: ignore[no-untyped-def]
    """Largest move of a contact or change of its force, 1 being as far as what they add together is left as it was."""
    most = 0.0
    for c in range(len(touch)):
        away = np.sqrt((touch[c, 0] - before[c, 0]) ** 2 + (touch[c, 1] - before[c, 1]) ** 2)
        most = max(most, away / MOVED_M, abs(touch[c, 2] / before[c, 2] - 1.0) / MOVED_SHARE)
    return most


@njit(inline="always")
def _weighed(rows, variance, products):  # type: ignore[no-untyped-def]
    """Misfit and log determinant of the covariance, the errors integrated out.

    ``rows`` (2n+1,D): possible errors, slopes, residual. Elimination of the errors from the symmetric matrix
    ``products`` (2n+1,2n+1) of all their products, the noise's variance on its diagonal, leaves what is wanted of the
    others, in units of it.
    """
    last = len(rows) - 1
    for i in range(len(rows)):
        for j in range(i, len(rows)):
            products[i, j] = dot(rows[i], rows[j])
    logarithm = rows.shape[1] * np.log(variance)
    for k in range(last // 2):
        products[k, k] += variance
        logarithm += np.log(products[k, k] / variance)
        _eliminate(products, k)
    for i in range(last // 2, len(rows)):
        for j in range(i, len(rows)):
            products[i, j] /= variance
    return products[last, last], logarithm


@njit(inline="always")
def _keep(products, gradient, curvature):  # type: ignore[no-untyped-def]
    """Fill gradient (n,) and curvature (n,n) of the misfit from the weighed ``products`` (2n+1,2n+1)."""
    count = len(gradient)
    for i in range(count):
        gradient[i] = products[count + i, 2 * count]
        for j in range(i, count):
            curvature[i, j] = curvature[j, i] = products[count + i, count + j]


@njit(cache=True, nogil=True, error_model="numpy")
def _eliminate(matrix, k):  # type: ignore[no-untyped-def]
    """Eliminate unknown ``k``, all before it being gone, from symmetric equations of which the upper half is kept."""
    first = matrix[k]
    for i in range(k + 1, len(matrix)):
        share, row = first[i] / first[k], matrix[i]
        for j in range(i, len(matrix)):
            row[j] -= share * first[j]


@njit(inline="always")
def _stepped(touch, gradient, curvature, damping, low, high, tried):  # type: ignore[no-untyped-def]
    """Fill ``tried`` (C,3) with the contacts a damped step further; what the misfit would fall by if it were as
    straight as it looks and the step as long as it wants."""
    count = len(gradient)
    damped, step, promised = np.zeros((count + 1, count + 1)), np.empty(count), 0.0
    for k in range(count):
        for j in range(k, count):
            damped[k, j] = curvature[k, j]
        damped[k, k] += damping * curvature[k, k] + 1e-12
        damped[k, count] = gradient[k]
    for k in range(count):
        _eliminate(damped, k)
    for k in range(count - 1, -1, -1):
        step[k] = damped[k, count]
        for j in range(k + 1, count):
            step[k] -= damped[k, j] * step[j]
        step[k] /= damped[k, k]
        promised += gradient[k] * step[k]
    for c in range(len(touch)):
        for k in range(2):
            moved = touch[c, k] + min(max(step[3 * c + k], -MOST_STEP_M), MOST_STEP_M)
            tried[c, k] = min(max(moved, low[k]), high[k])
        stronger = touch[c, 2] * np.exp(min(max(step[3 * c + 2], -1.0), 1.0))
        tried[c, 2] = min(max(stronger, low[2]), high[2])
    return promised


def log_evidence(fit: Fit, low: Array, high: Array) -> float:
    """Log probability of a reading under as many contacts: places uniform, forces uniform in their logarithm.

    Where the reading tells nothing of a contact the posterior is as wide as the prior, and no wider.
    """
    ranges = high[0] - low[0], high[1] - low[1], log(high[2] / low[2])
    _, volume = inverse(fit.curvature, *(2.0 * pi / some**2 for some in ranges))
    prior = sum(log(some) for some in ranges) - 1.5 * log(2.0 * pi)
    return -0.5 * (fit.misfit + fit.logarithm + volume) - len(fit.touch) * prior


def covariances(fit: Fit) -> Array:
    """(C,3,3) of each contact's x, y and log force."""
    return np.asarray(inverse(fit.curvature, LEAST_CURVATURE, LEAST_CURVATURE, LEAST_CURVATURE)[0])


@njit(cache=True, nogil=True, error_model="numpy")
def inverse(curvature, x, y, force):  # type: ignore[no-untyped-def]
    """(C,3,3) blocks on the diagonal of the inverse of ``curvature`` (3C,3C) with as much more on its own diagonal, and
    its log determinant."""
    count, more, logarithm = len(curvature), (x, y, force), 0.0
    blocks, both = np.empty((count // 3, 3, 3)), np.zeros((2 * count, 2 * count))
    for i in range(count):
        for j in range(i, count):
            both[i, j] = curvature[i, j]
        both[i, i] += more[i % 3]
        both[i, count + i] = 1.0
    for k in range(count):
        _eliminate(both, k)
        logarithm += np.log(both[k, k])
    for c in range(len(blocks)):
        for a in range(3):
            for b in range(3):
                blocks[c, a, b] = -both[count + 3 * c + min(a, b), count + 3 * c + max(a, b)]
    return blocks, logarithm


@njit(cache=True, nogil=True, error_model="numpy")
def stated(touch, spline, error, widening, covariance):  # type: ignore[no-untyped-def]
    """Turn covariances (n,3,3) by log force, of contacts (n,3), into those by force, with ``error`` (4,)."""
    rows = np.empty((7, spline[3].shape[3]))
    for c in range(len(touch)):
        tangents_at(spline[0], spline[1], spline[2], spline[3], touch[c, 0], touch[c, 1], touch[c, 2], rows)
        # Newton that change the response by as much as it is.
        per_size_n = np.sqrt(dot(rows[0], rows[0]) / dot(rows[3], rows[3]))
        for a in range(3):
            for b in range(3):
                covariance[c, a, b] *= (touch[c, 2] if a == 2 else 1.0) * (touch[c, 2] if b == 2 else 1.0)
            covariance[c, a, a] += (error[a] * (per_size_n if a == 2 else 1.0)) ** 2
        for a in range(3):
            for b in range(3):
                covariance[c, a, b] *= widening
        # Presses that the same load cell read have had no part in the widening of this.
        covariance[c, 2, 2] += (error[3] * touch[c, 2]) ** 2
