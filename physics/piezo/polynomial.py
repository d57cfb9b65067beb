"""Sheet resistance against pressure: the paper's fifth-order polynomial (II-C), fitted to the specimen test."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numba import njit
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from ertskin.physics.least_distance import nearest_point

Array = NDArray[np.float64]

ORDER = 5
CHECKED = 400
"""Pressures at which a law is looked at."""
BLOCK = 128  # points whose law is summed together


def _least_squares_nonincreasing(design: Array, target: Array, slopes: Array) -> Array:
    """Coefficients c minimising |design c - target| with slopes @ c <= 0 (Lawson & Hanson's LSI)."""
    q, r = np.linalg.qr(design)
    never_rising = nearest_point(q.T @ target, -np.linalg.solve(r.T, slopes.T).T, np.zeros(len(slopes)))
    if never_rising is None:
        raise ValueError("no law that never rises was found for this specimen")
    return np.asarray(np.linalg.solve(r, never_rising), dtype=float)


@dataclass(frozen=True, eq=False)
class PiezoPolynomial:
    """Sheet resistance in ohm per square against pressure in pascal, never rising, held constant outside the specimen.

    ``coefficients`` are those of Chebyshev polynomials in 2 p/max_stress_pa - 1, divided by the value at zero stress,
    ``zero_ohm_sq``. Below zero pressure (a bonded pad can pull) the value at zero holds, above ``max_stress_pa`` the
    value there.
    """

    coefficients: Array
    max_stress_pa: float
    zero_ohm_sq: float

    @classmethod
    def fit(cls, stress_pa: Array, sheet_resistance_ohm_sq: Array, order: int = ORDER) -> PiezoPolynomial:
        """Fit a specimen test: stresses (N,) in pascal, sheet resistances (N,) in ohm per square, all its cycles.

        The noise is a fraction of the value, so residuals are weighted by the fitted value (iterated). Loading and
        unloading weigh alike: the hysteresis is averaged, as in the paper. Raises ``ValueError`` on data that can't
        fix the polynomial.
        """
        stress = np.asarray(stress_pa, dtype=float)
        resistance = np.asarray(sheet_resistance_ohm_sq, dtype=float)
        good = np.isfinite(stress) & np.isfinite(resistance)
        stress, resistance = stress[good], resistance[good]
        if len(np.unique(stress)) <= order:
            raise ValueError(f"a polynomial of order {order} needs more than {order} different stresses")
        if np.any(resistance <= 0) or stress.max() <= 0:
            raise ValueError("the specimen needs positive sheet resistances and a positive largest stress")
        largest = float(stress.max())
        design = chebyshev.chebvander(2 * stress / largest - 1, order)
        slopes = _slope_matrix(np.linspace(-1.0, 1.0, CHECKED), order)
        fitted = resistance
        for _ in range(6):
            coefficients = _least_squares_nonincreasing(design / fitted[:, None], resistance / fitted, slopes)
            fitted = design @ coefficients
        zero = float(chebyshev.chebval(-1.0, coefficients))
        return cls(coefficients / zero, largest, zero)

    def sheet_resistance_ohm_sq(self, pressure_pa: Array) -> Array:
        """(...,) ohm per square at pressures (...,) in pascal."""
        pressure = np.asarray(pressure_pa, dtype=float)
        coefficients = np.ascontiguousarray(self.zero_ohm_sq * self.coefficients)
        return np.asarray(_law(pressure.ravel(), coefficients, self.max_stress_pa)).reshape(pressure.shape)

    @cached_property
    def least_ohm_sq(self) -> float:
        """The smallest sheet resistance at any pressure, in ohm per square: of a fit gone astray it isn't positive."""
        return float(self.sheet_resistance_ohm_sq(np.linspace(0.0, self.max_stress_pa, CHECKED)).min())

    def derivative(self, pressure_pa: Array) -> Array:
        """(...,) ohm per square per pascal at pressures (...,) in pascal; zero where the law is held constant."""
        pressure = np.asarray(pressure_pa, dtype=float)
        slope = chebyshev.chebval(self._coordinate(pressure), chebyshev.chebder(self.coefficients))
        inside = (pressure >= 0) & (pressure <= self.max_stress_pa)
        return np.where(inside, 2 * self.zero_ohm_sq / self.max_stress_pa * slope, 0.0)

    def basis(self, pressure_pa: Array) -> Array:
        """(..., 6) derivative of the sheet resistance by ``zero_ohm_sq`` times each coefficient, dimensionless."""
        return np.asarray(chebyshev.chebvander(self._coordinate(pressure_pa), len(self.coefficients) - 1), dtype=float)

    def shifted(self, change_ohm_sq: Array) -> PiezoPolynomial:
        """The law with changes (6,) added to ``zero_ohm_sq`` times its coefficients."""
        total = self.zero_ohm_sq * self.coefficients + change_ohm_sq
        zero = float(chebyshev.chebval(-1.0, total))
        return replace(self, coefficients=total / zero, zero_ohm_sq=zero)

    def scaled(self, zero_ohm_sq: float) -> PiezoPolynomial:
        """The same law with another value at zero stress, everything in proportion."""
        return replace(self, zero_ohm_sq=float(zero_ohm_sq))

    def _coordinate(self, pressure_pa: Array) -> Array:
        return 2 * np.clip(np.asarray(pressure_pa, dtype=float) / self.max_stress_pa, 0.0, 1.0) - 1


@njit(cache=True, nogil=True, fastmath={"contract"})
def _law(pressure_pa, coefficients, largest_pa):  # type: ignore[no-untyped-def]
    """Clenshaw's sum, block by block: millions of points are evaluated for every parameter a diagnosis moves."""
    result = np.empty_like(pressure_pa)
    twice, last, before = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    for first in range(0, len(pressure_pa), BLOCK):
        count = min(BLOCK, len(pressure_pa) - first)
        for k in range(count):
            twice[k] = 4 * min(max(pressure_pa[first + k] / largest_pa, 0.0), 1.0) - 2
        last[:], before[:] = 0.0, 0.0
        for n in range(len(coefficients) - 1, 0, -1):
            for k in range(count):
                now = coefficients[n] + twice[k] * last[k] - before[k]
                before[k], last[k] = last[k], now
        for k in range(count):
            result[first + k] = coefficients[0] + 0.5 * twice[k] * last[k] - before[k]
    return result


def _slope_matrix(coordinate: Array, order: int) -> Array:
    """(N, order+1) derivatives of the Chebyshev polynomials at coordinates (N,)."""
    columns = [chebyshev.chebval(coordinate, chebyshev.chebder(unit)) for unit in np.eye(order + 1)]
    return np.stack(columns, axis=1)
