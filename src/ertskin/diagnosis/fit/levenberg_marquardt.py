"""Levenberg-Marquardt on normal equations, with bounds, priors and rows in folds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Quadratic:
    """Half chi-square near a point: cost - gradient.d + d'hessian d/2, by fold (F,), (F,n), (F,n,n)."""

    cost: Array
    gradient: Array
    hessian: Array

    def add(self, fold: int, wrong: Array, columns: Array, which: NDArray[np.intp], share: float = 1.0) -> None:
        """Count residuals (m,) with their ``columns`` (m,c) by the variables ``which`` (c,) in a fold."""
        self.cost[fold] += 0.5 * share * float(wrong @ wrong)
        self.gradient[fold, which] += share * (columns.T @ wrong)
        self.hessian[fold, which[:, None], which] += share * (columns.T @ columns)


@dataclass(frozen=True, eq=False)
class Fit:
    """Where the descent ended: values (n,), the quadratic there (prior not included), the prior's Hessian and mean."""

    value: Array
    quadratic: Quadratic
    prior: Array
    steps: int
    prior_mean: Array | float = 0.0

    @property
    def from_prior(self) -> Array:
        """(n,) how far the values are from the prior's mean."""
        return np.asarray(self.value - self.prior_mean)

    @property
    def covariance(self) -> Array:
        """(n,n) of the estimate."""
        return np.asarray(np.linalg.pinv(self.quadratic.hessian.sum(axis=0) + self.prior))

    @property
    def robust_covariance(self) -> Array:
        """(n,n) of the estimate where what a wrong form leaves is alike within a fold (Liang and Zeger 1986)."""
        pulls = self.quadratic.gradient @ self.covariance
        folds = len(pulls)
        return np.asarray(pulls.T @ pulls * folds / (folds - 1))


Linearise = Callable[[Array], Quadratic]
Cost = Callable[[Array], float]


def descend(
    linearise: Linearise,
    cost: Cost,
    start: Array,
    low: Array,
    high: Array,
    prior_mean: Array,
    prior_precision: Array,
    *,
    steps: int = 12,
    tolerance: float = 0.05,
    longest: Array | float = np.inf,
) -> Fit:
    """Minimise cost(x) + prior within bounds; ``cost`` and ``linearise`` are half chi-squares.

    Stops when a step gains less than ``tolerance`` in half chi-square. No step is longer than ``longest`` (n,):
    what the data hardly tell of would be taken to where nothing is as linearised.
    """
    value = np.clip(start, low, high)
    prior = np.diag(prior_precision)

    def total(x: Array) -> float:
        return cost(x) + 0.5 * float(((x - prior_mean) ** 2 * prior_precision).sum())

    lowest, damping, taken = total(value), 1e-6, 0
    quadratic = linearise(value)
    while taken < steps:
        taken += 1
        gradient = quadratic.gradient.sum(axis=0) - prior_precision * (value - prior_mean)
        hessian = quadratic.hessian.sum(axis=0) + prior
        bounds = np.maximum(low, value - longest), np.minimum(high, value + longest)
        value, reached, damping = _downhill(total, (value, lowest), gradient, hessian, bounds, damping, tolerance)
        gained, lowest = lowest - reached, reached
        if gained <= 0:
            break
        quadratic = linearise(value)
        if gained < tolerance:
            break
    return Fit(value, quadratic, prior, taken, prior_mean)


def _downhill(
    total: Cost,
    begun: tuple[Array, float],
    gradient: Array,
    hessian: Array,
    bounds: tuple[Array, Array],
    damping: float,
    tolerance: float,
) -> tuple[Array, float, float]:
    """Where the first of ever more damped steps from a point and its cost comes down to, the cost, the damping next.

    The point itself where none comes down, or what the step promises is less than ``tolerance``.
    """
    value, lowest = begun
    for _ in range(8):
        step = bounded_step(gradient, hessian, value, *bounds, damping)
        if not np.isfinite(step).all():
            break
        trial = np.clip(value + step, *bounds)
        trial_cost = total(trial)
        if trial_cost < lowest:
            return trial, trial_cost, max(damping / 10, 1e-9)
        if float(gradient @ step) < tolerance:
            break
        damping = max(damping * 20, 1e-4)
    return value, lowest, damping


def bounded_step(gradient: Array, hessian: Array, value: Array, low: Array, high: Array, damping: float) -> Array:
    """Damped Newton step with variables that lean on a bound held there."""
    scale = np.maximum(np.diag(hessian), 1e-300)
    free = np.ones(len(value), dtype=bool)
    step = np.zeros(len(value))
    for _ in range(4):
        step[:] = 0.0
        index = np.flatnonzero(free)
        if not len(index):
            break
        root = np.sqrt(scale[index])
        matrix = hessian[np.ix_(index, index)] / root[:, None] / root + damping * np.eye(len(index))
        step[index] = np.linalg.lstsq(matrix, gradient[index] / root, rcond=1e-12)[0] / root
        stuck = free & (((value <= low) & (step < 0)) | ((value >= high) & (step > 0)))
        if not stuck.any():
            break
        free &= ~stuck
    return step
