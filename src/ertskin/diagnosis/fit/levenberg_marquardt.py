"""Levenberg-Marquardt on normal equations, with bounds, priors and rows in folds.

Where what is left of the residuals is large, as it is while an effect is missing, their own curvature counts: how the
slope changes from step to step tells of it (Dennis, Gay & Welsch, ACM Trans. Math. Softw. 7 (1981) 348).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TRIES = 8
"""Ever more damped steps that are tried."""
TINY = 1e-300
LEAST_CURVATURE = 1e-9
"""Of a direction along which the cost would bend downwards, in units of the tangents' own curvature."""


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
class Tangent:
    """Of a cost at a point: by how much it falls along each variable, ``slope`` (n,), and its ``curvature`` (n,n)."""

    slope: Array
    curvature: Array

    def promised(self, step: Array) -> float:
        """What a step (n,) is expected to gain."""
        return float(self.slope @ step - 0.5 * step @ self.curvature @ step)


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
    def tangent(self) -> Tangent:
        """Of the cost with the prior, where the descent ended."""
        slope = self.quadratic.gradient.sum(axis=0) - self.prior.diagonal() * self.from_prior
        return Tangent(slope, self.quadratic.hessian.sum(axis=0) + self.prior)

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
    bending: bool = True,
) -> Fit:
    """Minimise cost(x) + prior within bounds; ``cost`` and ``linearise`` are half chi-squares.

    Stops when a step gains less than ``tolerance`` in half chi-square. No step is longer than ``longest`` (n,):
    what the data hardly tell of would be taken to where nothing is as linearised. ``bending``: whether the residuals'
    own curvature is told by the slopes, which must be those of the cost for it.
    """
    value = np.clip(start, low, high)
    prior = np.diag(prior_precision)

    def total(x: Array) -> float:
        return cost(x) + 0.5 * float(((x - prior_mean) ** 2 * prior_precision).sum())

    def tangent(quadratic: Quadratic) -> Tangent:
        slope = quadratic.gradient.sum(axis=0) - prior_precision * (value - prior_mean)
        return Tangent(slope, quadratic.hessian.sum(axis=0) + prior)

    lowest, damping, taken = total(value), 1e-6, 0
    quadratic = linearise(value)
    flat, bent, trusted = tangent(quadratic), np.zeros_like(prior), False
    while taken < steps:
        taken += 1
        bounds = np.maximum(low, value - longest), np.minimum(high, value + longest)
        begun, curved = value, Tangent(flat.slope, _uphill(flat.curvature, bent))
        model = curved if trusted else flat
        value, reached, damping = _downhill(total, (value, lowest), model, bounds, damping, tolerance)
        gained, lowest = lowest - reached, reached
        if gained <= 0:
            break
        quadratic = linearise(value)
        if gained < tolerance:
            break
        step, before, flat = value - begun, flat, tangent(quadratic)
        if bending:
            # The model that foretold this step better leads the next one.
            trusted = abs(curved.promised(step) - gained) < abs(before.promised(step) - gained)
            bent = _bent(bent, flat.curvature, step, before.slope - flat.slope)
    return Fit(value, quadratic, prior, taken, prior_mean)


def _bent(bent: Array, curvature: Array, step: Array, fall: Array) -> Array:
    """Curvature (n,n) beyond that of the tangents, ``curvature`` (n,n), after a step (n,) in which the slope fell by
    ``fall`` (n,): what was known of it, scaled to what the step shows, and the least change that agrees with the step.
    """
    beyond, along = fall - curvature @ step, float(step @ fall)
    if not 0 < along < np.inf:
        return bent
    known = float(step @ bent @ step)
    sized = bent * min(1.0, abs(float(step @ beyond)) / abs(known)) if known else bent
    wrong = beyond - sized @ step
    mixed = np.outer(wrong, fall)
    return np.asarray(sized + (mixed + mixed.T) / along - float(step @ wrong) * np.outer(fall, fall) / along**2)


def _uphill(curvature: Array, bent: Array) -> Array:
    """The sum of both curvatures (n,n), nowhere downwards: in units of the first, which is upwards everywhere, and that
    alone for variables that show nothing now."""
    if not bent.any():
        return curvature
    shown = np.diag(curvature) > 0
    root = np.sqrt(np.where(shown, np.diag(curvature), 1.0))
    scale = root[:, None] * root
    size, vector = np.linalg.eigh((curvature + np.where(shown[:, None] & shown, bent, 0.0)) / scale)
    return np.asarray((vector * np.maximum(size, LEAST_CURVATURE)) @ vector.T * scale)


def _downhill(
    total: Cost,
    begun: tuple[Array, float],
    model: Tangent,
    bounds: tuple[Array, Array],
    damping: float,
    tolerance: float,
) -> tuple[Array, float, float]:
    """Where the first of ever more damped steps from a point and its cost comes down to, the cost, the damping next.

    The point itself where none comes down, or what the step promises is less than ``tolerance``.
    """
    value, lowest = begun
    for _ in range(TRIES):
        step = bounded_step(model, value, *bounds, damping)
        if not np.isfinite(step).all():
            break
        trial = np.clip(value + step, *bounds)
        promised = model.promised(trial - value)
        # A step that a bound cuts short may lead uphill.
        trial_cost = total(trial) if promised > 0 else np.inf
        if trial_cost < lowest:
            return trial, trial_cost, max(damping / 10, 1e-9)
        if 0 <= promised < tolerance:
            break
        damping = max(damping * 20, 1e-4)
    return value, lowest, damping


def bounded_step(model: Tangent, value: Array, low: Array, high: Array, damping: float) -> Array:
    """Damped Newton step in which variables that would go beyond a bound go to it, and the others know that."""
    root = np.sqrt(np.maximum(np.diag(model.curvature), TINY))
    free = np.ones(len(value), dtype=bool)
    step = np.zeros(len(value))
    while free.any():
        index = np.flatnonzero(free)
        slope = model.slope[index] - model.curvature[np.ix_(index, ~free)] @ step[~free]
        matrix = model.curvature[np.ix_(index, index)] / root[index, None] / root[index] + damping * np.eye(len(index))
        step[index] = np.linalg.lstsq(matrix, slope / root[index], rcond=1e-12)[0] / root[index]
        beyond = free & ((value + step < low) | (value + step > high))
        if not beyond.any():
            break
        step[beyond] = np.where(step > 0, high - value, low - value)[beyond]
        free &= ~beyond
    return step
