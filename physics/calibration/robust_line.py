"""A straight line through points of which a few may be far off: Huber's estimator with its standard errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TUNING = 1.345
"""Huber's bend in robust sigmas: 95 % of least squares' efficiency on Gaussian noise."""


@dataclass(frozen=True)
class RobustLine:
    """y = slope x + intercept; ``sigma`` is the robust scatter about it (1.4826 times the median absolute residual)."""

    slope: float
    intercept: float
    slope_standard_error: float
    intercept_standard_error: float
    sigma: float

    @classmethod
    def fit(cls, x: Array, y: Array) -> RobustLine:
        """Fit to (N,) points, iterating Huber's weights to convergence.

        Raises ``ValueError`` with fewer than three finite points or only one abscissa.
        """
        good = np.isfinite(x) & np.isfinite(y)
        x, y = np.asarray(x, dtype=float)[good], np.asarray(y, dtype=float)[good]
        if len(x) < 3 or np.ptp(x) == 0:
            raise ValueError("a line needs at least three points at different abscissae")
        design = np.stack([x, np.ones_like(x)], axis=1)
        parameters = _theil_sen(x, y)
        for _ in range(100):
            residual = y - design @ parameters
            sigma = _scale(residual)
            weight = np.minimum(1.0, _TUNING * sigma / np.maximum(np.abs(residual), 1e-300))
            previous = parameters
            parameters = np.asarray(np.linalg.solve(design.T @ (weight[:, None] * design), design.T @ (weight * y)))
            if np.all(np.abs(parameters - previous) <= 1e-12 * (np.abs(parameters) + np.abs(previous))):
                break
        residual = y - design @ parameters
        sigma = _scale(residual)
        clipped = np.clip(residual, -_TUNING * sigma, _TUNING * sigma)
        inside = np.mean(np.abs(residual) <= _TUNING * sigma)
        variance = (clipped**2).sum() / (len(x) - 2) / inside**2
        errors = np.sqrt(np.diag(variance * np.linalg.inv(design.T @ design)))
        return cls(float(parameters[0]), float(parameters[1]), float(errors[0]), float(errors[1]), sigma)


def _scale(residual: Array) -> float:
    return float(max(1.4826 * np.median(np.abs(residual)), 1e-12 * np.abs(residual).max(), 1e-300))


def _theil_sen(x: Array, y: Array) -> Array:
    """Slope and intercept by the median of pairwise slopes, thinned to at most 500 points: the start."""
    thin = np.linspace(0, len(x) - 1, min(len(x), 500)).astype(int)
    i, j = np.triu_indices(len(thin), 1)
    i, j = thin[i], thin[j]
    apart = x[i] != x[j]
    slope = np.median((y[j] - y[i])[apart] / (x[j] - x[i])[apart])
    return np.array([slope, np.median(y - slope * x)])
