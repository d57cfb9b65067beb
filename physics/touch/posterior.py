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

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.physics.touch.table import added_together, tangents_at

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
MOVED_M, MOVED_SHARE = 1e-3, 0.1
SETTLED = 0.03
"""What contacts add together is found anew once one has moved this far or its force by that share; at the end, of
these, by so much: it changes slowly, and costs more than all the rest."""
APART_M = 8e-3
"""Two contacts nearer than this are one."""


@njit(cache=True, nogil=True)
def linearised(touch, spline, added, spread, predicted, rows):  # type: ignore[no-untyped-def]
    """Fill prediction (D,) and ``rows`` (6C,D) for contacts (C,3) that add ``added`` (D,) together: first the possible
    errors of all contacts, three each, then their slopes by x, y and log force."""
    tangents = np.empty((7, len(predicted)))
    slopes = NUISANCES * len(touch)
    predicted[:] = added
    for c in range(len(touch)):
        tangents_at(spline[0], spline[1], spline[2], spline[3], touch[c, 0], touch[c, 1], touch[c, 2], tangents)
        predicted += tangents[0]
        rows[slopes + 3 * c] = tangents[1]
        rows[slopes + 3 * c + 1] = tangents[2]
        rows[slopes + 3 * c + 2] = touch[c, 2] * tangents[3]
        across(tangents)
        for k in range(NUISANCES):
            rows[NUISANCES * c + k] = spread[k] * SHAPE_M**2 * tangents[4 + k]


@njit(cache=True, nogil=True)
def across(rows):  # type: ignore[no-untyped-def]
    """Leave of each of the ``TANGENTS`` (7,D) from force and place on what lies across those before (Gram-Schmidt)."""
    order = (3, 1, 2, 4, 5, 6)
    for k in range(1, len(order)):
        row = rows[order[k]]
        for before in range(k):
            one = rows[order[before]]
            square = one @ one
            if square > 0.0:
                share = (row @ one) / square
                for d in range(len(row)):
                    row[d] -= share * one[d]


@njit(cache=True, nogil=True)
def added_by(touch, cells, width):  # type: ignore[no-untyped-def]
    """(D,) what contacts (C,3) add together to the sum of what each does."""
    return added_together(touch, *cells) if len(touch) > 1 else np.zeros(width)


@njit(cache=True, nogil=True)
def _moved(touch, before):  # type: ignore[no-untyped-def]
    """Largest move of a contact or change of its force, 1 being as far as what they add together is left as it was."""
    most = 0.0
    for c in range(len(touch)):
        away = np.sqrt((touch[c, 0] - before[c, 0]) ** 2 + (touch[c, 1] - before[c, 1]) ** 2)
        most = max(most, away / MOVED_M, abs(touch[c, 2] / before[c, 2] - 1.0) / MOVED_SHARE)
    return most


@njit(cache=True, nogil=True)
def weighed(rows, variance):  # type: ignore[no-untyped-def]
    """Misfit, gradient (n,), curvature (n,n) and log determinant of the covariance, the errors integrated out.

    ``rows`` (2n+1,D): possible errors, slopes, residual. Elimination of the errors from the symmetric matrix of all
    their products, the noise's variance on its diagonal, leaves what is wanted of the others.
    """
    products = rows @ rows.T
    last = len(rows) - 1
    errors = last // 2
    logarithm = rows.shape[1] * np.log(variance)
    for k in range(errors):
        products[k, k] += variance
        logarithm += np.log(products[k, k] / variance)
        eliminate(products, k)
    for i in range(errors, len(rows)):
        for j in range(i, len(rows)):
            products[i, j] /= variance
            products[j, i] = products[i, j]
    return (
        products[last, last],
        products[errors:last, last].copy(),
        products[errors:last, errors:last].copy(),
        logarithm,
    )


@njit(cache=True, nogil=True)
def eliminate(matrix, k):  # type: ignore[no-untyped-def]
    """Eliminate unknown ``k``, all before it being gone, from symmetric equations of which the upper half is kept."""
    first = matrix[k]
    for i in range(k + 1, len(matrix)):
        share, row = first[i] / first[k], matrix[i]
        for j in range(i, len(matrix)):
            row[j] -= share * first[j]


@njit(cache=True, nogil=True)
def refined(reading, start, spline, cells, spread, remainder, low, high):  # type: ignore[no-untyped-def]
    """Most probable contacts (C,3) from ``start``, misfit, its curvature (3C,3C) by x, y, log force, log determinant.

    Found first as if the response erred by ``COARSE``, which smooths the misfit, then as it is. The rest as in
    ``descended``.
    """
    near = descended(reading, start, spline, cells, COARSE_SPREAD * spread, max(COARSE, remainder), low, high)[0]
    return descended(reading, near, spline, cells, spread, remainder, low, high)


@njit(cache=True, nogil=True)
def descended(reading, start, spline, cells, spread, remainder, low, high):  # type: ignore[no-untyped-def]
    """Most probable contacts (C,3) from ``start``, misfit, its curvature (3C,3C) by x, y, log force, log determinant.

    ``remainder``: rms of the response's error outside ``spread``, as a share of the response. ``low``, ``high`` (3,):
    bounds of place and force.
    """
    count, width = len(start), len(reading)
    touch = start.copy()
    predicted, rows = np.empty(width), np.empty((2 * NUISANCES * count + 1, width))
    added, known = added_by(touch, cells, width), touch
    variance = _compared(reading, touch, spline, added, spread, remainder, predicted, rows)
    misfit, gradient, curvature, logarithm = weighed(rows, variance)
    damping = DAMPING
    for _ in range(STEPS):
        tried, promised = _stepped(touch, gradient, curvature, damping, low, high)
        also = _compared(reading, tried, spline, added, spread, remainder, predicted, rows)
        found = weighed(rows, also)
        gained = misfit + logarithm - found[0] - found[3]
        better = gained > 0.0
        settled = (gained if better else promised) < CONVERGED
        if better:
            touch, misfit, gradient, curvature, logarithm = tried, found[0], found[1], found[2], found[3]
        damping = max(0.1 * damping, 1e-9) if better else 10.0 * damping
        if count > 1 and (better or settled) and _moved(touch, known) > (SETTLED if settled else 1.0):
            added, known = added_by(touch, cells, width), touch
            variance = _compared(reading, touch, spline, added, spread, remainder, predicted, rows)
            misfit, gradient, curvature, logarithm = weighed(rows, variance)
        elif settled or damping > 1e6:
            break
    return touch, misfit, curvature, logarithm


@njit(cache=True, nogil=True)
def _stepped(touch, gradient, curvature, damping, low, high):  # type: ignore[no-untyped-def]
    """Contacts (C,3) a damped step further, and what the misfit would fall by if it were as straight as it looks and
    the step as long as it wants."""
    damped = curvature.copy()
    for k in range(len(gradient)):
        damped[k, k] *= 1.0 + damping
        damped[k, k] += 1e-12
    step = np.linalg.solve(damped, gradient)
    tried = touch.copy()
    for c in range(len(touch)):
        for k in range(2):
            moved = touch[c, k] + min(max(step[3 * c + k], -MOST_STEP_M), MOST_STEP_M)
            tried[c, k] = min(max(moved, low[k]), high[k])
        stronger = touch[c, 2] * np.exp(min(max(step[3 * c + 2], -1.0), 1.0))
        tried[c, 2] = min(max(stronger, low[2]), high[2])
    return tried, gradient @ step


@njit(cache=True, nogil=True)
def _compared(reading, touch, spline, added, spread, remainder, predicted, rows):  # type: ignore[no-untyped-def]
    """``linearised``, with the residual (D,) in the last of ``rows``; the variance of the noise with ``remainder``."""
    linearised(touch, spline, added, spread, predicted, rows)
    rows[-1] = reading - predicted
    return 1.0 + remainder**2 * (predicted @ predicted) / len(reading)


@njit(cache=True, nogil=True)
def log_evidence(touch, misfit, curvature, logarithm, low, high):  # type: ignore[no-untyped-def]
    """Log probability of a reading under as many contacts: places uniform, forces uniform in their logarithm.

    Where the reading tells nothing of a contact the posterior is as wide as the prior, and no wider.
    """
    total = -0.5 * (misfit + logarithm)
    count = len(touch)
    if count == 0:
        return total
    log_range = np.log(high[2] / low[2])
    bounded = curvature.copy()
    for c in range(count):
        for k in range(2):
            bounded[3 * c + k, 3 * c + k] += 2.0 * np.pi / (high[k] - low[k]) ** 2
        bounded[3 * c + 2, 3 * c + 2] += 2.0 * np.pi / log_range**2
        total -= np.log((high[0] - low[0]) * (high[1] - low[1]) * log_range)
    _, volume = np.linalg.slogdet(bounded)
    return total + 1.5 * count * np.log(2.0 * np.pi) - 0.5 * volume
