"""A radially symmetric field around a point force, tabulated for fast evaluation at millions of points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]

_ENTRIES = 1 << 18


@dataclass(frozen=True, eq=False)
class RadialKernel:
    """A field f(r), zero beyond ``radius_m``, tabulated at equal steps of r squared.

    No square root and no search is needed to look a point up, and f is smooth in r squared. ``value`` and ``slope``
    (N+2,) hold f and df/d(r^2); linear interpolation between 262,144 entries is good to 1e-6 of the peak for a field
    whose width at half height is a twentieth of the radius.
    """

    radius_m: float
    value: Array
    slope: Array

    @classmethod
    def through(cls, radius_m: Array, value: Array) -> RadialKernel:
        """The kernel through samples (N,) at increasing radii (N,) from 0, by a cubic spline flat at r = 0."""
        spline = CubicSpline(radius_m, value, bc_type=((1, 0.0), "not-a-knot"))
        largest = float(radius_m[-1])
        squared = np.linspace(0.0, largest**2, _ENTRIES)
        r = np.sqrt(squared)
        slope = np.empty(_ENTRIES)
        slope[1:] = spline(r[1:], 1) / (2 * r[1:])
        slope[0] = 0.5 * float(spline(0.0, 2))
        end = np.zeros(2)
        return cls(largest, np.concatenate([spline(r), end]), np.concatenate([slope, end]))

    def mean_around(self, point_m: Array, offset_m: Array) -> Array:
        """(...,) the mean of the fields around points (P,2), at offsets (...,2) in metre."""
        offset = np.asarray(offset_m, dtype=float)
        flat = np.ascontiguousarray(offset.reshape(-1, 2))
        found = _looked_up_around(self.value, np.asarray(point_m, dtype=float), flat, self._per_entry)
        return np.asarray(found / len(point_m)).reshape(offset.shape[:-1])

    def derivative(self, squared_m2: Array) -> Array:
        """(...,) df/d(r^2) at squared distances (...,) in square metre."""
        squared = np.asarray(squared_m2, dtype=float)
        return np.asarray(_looked_up(self.slope, squared.ravel(), self._per_entry)).reshape(squared.shape)

    @property
    def _per_entry(self) -> float:
        """Entries of a table per square metre."""
        return float((_ENTRIES - 1) / self.radius_m**2)


@njit(cache=True, nogil=True)
def _looked_up(table, squared, per_entry):  # type: ignore[no-untyped-def]
    found = np.empty_like(squared)
    for n in range(len(squared)):
        found[n] = _entry(table, squared[n] * per_entry)
    return found


@njit(cache=True, nogil=True)
def _looked_up_around(table, point, offset, per_entry):  # type: ignore[no-untyped-def]
    found = np.zeros(len(offset))
    for n in range(len(offset)):
        for p in range(len(point)):
            x, y = offset[n, 0] - point[p, 0], offset[n, 1] - point[p, 1]
            found[n] += _entry(table, (x * x + y * y) * per_entry)
    return found


@njit(cache=True, nogil=True, inline="always")
def _entry(table, position):  # type: ignore[no-untyped-def]
    inside = min(position, float(_ENTRIES))
    entry = int(inside)
    return table[entry] + (inside - entry) * (table[entry + 1] - table[entry])
