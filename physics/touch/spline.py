"""Cubic splines over place and force, with slopes, compiled (de Boor, A Practical Guide to Splines, 1978)."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline

Array = NDArray[np.float64]
Floats = NDArray[np.floating]


def coefficients(nodes: Array, values: Array, axis: int) -> tuple[Array, Array]:
    """Knots of the cubic spline through ``values`` at ``nodes`` along ``axis``, and the coefficients in their place."""
    spline = make_interp_spline(nodes, np.moveaxis(values, axis, 0), k=3)
    return spline.t, np.moveaxis(spline.c, 0, axis)


def evaluated(knots: Array, coefficient: Floats, at: Array, axis: int) -> Array:
    """Values ``at`` (n,) along ``axis``, in the place of the spline's coefficients there."""
    return np.moveaxis(BSpline(knots, np.moveaxis(coefficient, axis, 0), 3)(at), 0, axis)


@njit(cache=True, nogil=True)
def basis(knots, at, value):  # type: ignore[no-untyped-def]
    """Number of the first of the four splines that aren't zero ``at``.

    Fills ``value`` (3,4) with their values and first and second derivatives. Beyond the ends the outermost polynomial
    goes on.
    """
    span = 3
    while span < len(knots) - 5 and at >= knots[span + 1]:
        span += 1
    step = np.zeros((4, 4))
    step[0, 0] = 1.0
    for degree in range(1, 4):
        for k in range(degree + 1):
            left = span - degree + k
            if k > 0:
                step[degree, k] += (at - knots[left]) / (knots[left + degree] - knots[left]) * step[degree - 1, k - 1]
            if k < degree:
                right = knots[left + degree + 1]
                step[degree, k] += (right - at) / (right - knots[left + 1]) * step[degree - 1, k]
    for k in range(4):
        left = span - 3 + k
        value[0, k] = step[3, k]
        value[1, k] = 3.0 * _difference(knots, left, 3, step[2], k)
        value[2, k] = 0.0
        if k > 0:
            value[2, k] += 6.0 * _difference(knots, left, 2, step[1], k - 1) / (knots[left + 3] - knots[left])
        if k < 3:
            value[2, k] -= 6.0 * _difference(knots, left + 1, 2, step[1], k) / (knots[left + 4] - knots[left + 1])
    return span - 3


@njit(cache=True, nogil=True)
def _difference(knots, left, degree, lower, k):  # type: ignore[no-untyped-def]
    """B(left) / width - B(left + 1) / width of one degree lower: a degree-th of the slope of spline ``left``."""
    total = 0.0
    if k > 0:
        total += lower[k - 1] / (knots[left + degree] - knots[left])
    if k < degree:
        total -= lower[k] / (knots[left + degree + 1] - knots[left + 1])
    return total
