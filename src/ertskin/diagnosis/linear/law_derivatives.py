"""Derivatives of a pressed fabric's conductance by the coefficients of its law."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.physics.effects.piezo_chain import LEAST_RELATIVE
from ertskin.physics.piezo.polynomial import PiezoPolynomial

Array = NDArray[np.float64]


def conductance_by_law(
    law: PiezoPolynomial, pressure_pa: Array, factor: Array, weight: Array, count: int, power: Array | None = None
) -> NDArray[np.float32]:
    """(n,count,N) derivatives of the conductance over that at rest by the law's Chebyshev coefficients from 1 on.

    The law's value at zero stress is kept. ``pressure_pa`` (n,N) is what the law answers to, ``factor`` (n,N) or (1,1)
    multiplies its resistance, ``weight`` (N,) or (n,N) the derivatives; ``power`` (N,) is that to which the law's
    resistance over that at rest is raised.
    """
    if power is not None:
        relative = np.maximum(law.sheet_resistance_ohm_sq(pressure_pa) / law.zero_ohm_sq, LEAST_RELATIVE)
        weight = weight * power * relative ** (1 - power)
    result = np.empty((len(pressure_pa), count, pressure_pa.shape[1]), dtype=np.float32)
    factor, weight = (np.broadcast_to(part, pressure_pa.shape) for part in (factor, weight))
    coefficients = np.zeros(max(len(law.coefficients), 1 + count))
    coefficients[: len(law.coefficients)] = law.coefficients
    _by_law(result, pressure_pa, factor, weight, coefficients, law.max_stress_pa)
    return result


@njit(cache=True, nogil=True)
def _by_law(result, pressure_pa, factor, weight, coefficients, largest_pa):  # type: ignore[no-untyped-def]
    count, points = result.shape[1:]
    order = len(coefficients)
    polynomial = np.empty((order, points))
    for t in range(len(result)):
        along, unit = polynomial[1], polynomial[0]
        for n in range(points):
            unit[n] = 1.0
            along[n] = 2 * min(max(pressure_pa[t, n] / largest_pa, 0.0), 1.0) - 1
        for k in range(2, order):
            one, two, now = polynomial[k - 1], polynomial[k - 2], polynomial[k]
            for n in range(points):
                now[n] = 2 * along[n] * one[n] - two[n]
        law = np.zeros(points)
        for k in range(order):
            for n in range(points):
                law[n] += coefficients[k] * polynomial[k, n]
        for n in range(points):
            law[n] = -weight[t, n] / (factor[t, n] * law[n] * law[n])
        at_zero = -1.0
        for k in range(1, count + 1):
            for n in range(points):
                result[t, k - 1, n] = law[n] * (polynomial[k, n] - at_zero)
            at_zero = -at_zero
