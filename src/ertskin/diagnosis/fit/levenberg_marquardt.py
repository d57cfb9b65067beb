"""Levenberg-Marquardt on normal equations, with bounds, priors and rows in folds.

While an effect is missing residuals stay large, and the part of the Hessian that Gauss-Newton leaves out counts.
Secants estimate it, sized and updated as in Dennis, Gay & Welsch, ACM Trans. Math. Softw. 7 (1981) 348, but from how
the whole gradient changes.
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
"""Of a direction along which the augmented model would curve downwards, in units of its own diagonal."""
STEEPEST = 1e-8
"""Part of a step's Gauss-Newton curvature that its secant must have at least to be believed."""


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
class LocalModel:
    """A cost near a point: cost - slope.d + d'curvature d/2; ``slope`` (n,) is minus its gradient."""

    slope: Array
    curvature: Array

    @classmethod
    def of(cls, quadratic: Quadratic, prior: Array, from_prior: Array) -> LocalModel:
        """Gauss-Newton's, with a prior of diagonal Hessian (n,n), ``from_prior`` (n,) away from its mean."""
        slope = quadratic.gradient.sum(axis=0) - prior.diagonal() * from_prior
        return cls(slope, quadratic.hessian.sum(axis=0) + prior)

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
    def local_model(self) -> LocalModel:
        """Of the cost with the prior, where the descent ended."""
        return LocalModel.of(self.quadratic, self.prior, self.from_prior)

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


def _with_prior(cost: Cost, mean: Array, precision: Array) -> Cost:
    return lambda x: cost(x) + 0.5 * float(((x - mean) ** 2 * precision).sum())


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
    secants: bool = True,
) -> Fit:
    """Minimise cost(x) + prior within bounds; ``cost`` and ``linearise`` are half chi-squares.

    Stops when a step gains less than ``tolerance`` in half chi-square. No step is longer than ``longest`` (n,):
    what the data hardly tell of would be taken to where nothing is as linearised. ``secants`` estimate the second-order
    part of the Hessian, for which ``linearise`` must give the true gradient of ``cost``.
    """
    value, prior = np.clip(start, low, high), np.diag(prior_precision)
    total = _with_prior(cost, prior_mean, prior_precision)
    lowest, damping, taken = total(value), 1e-6, 0
    quadratic = linearise(value)
    model, second = LocalModel.of(quadratic, prior, value - prior_mean), _SecondOrder(np.zeros_like(prior))
    while taken < steps:
        taken += 1
        bounds, begun = (np.maximum(low, value - longest), np.minimum(high, value + longest)), value
        leading = second.augmented(model) if second.leads else model
        value, reached, damping = _downhill(total, (value, lowest), leading, bounds, damping, tolerance)
        gained, lowest = lowest - reached, reached
        if gained <= 0:
            break
        quadratic = linearise(value)
        if gained < tolerance:
            break
        before, model = model, LocalModel.of(quadratic, prior, value - prior_mean)
        if secants:
            second.learn(before, model, value - begun, gained)
    return Fit(value, quadratic, prior, taken, prior_mean)


@dataclass(eq=False)
class _SecondOrder:
    """The part (n,n) of a cost's Hessian that Gauss-Newton leaves out, as secants tell it.

    ``leads``: whether the model augmented by it foretold the last step's gain better than Gauss-Newton's, and makes the
    next step.
    """

    part: Array
    leads: bool = False

    def augmented(self, model: LocalModel) -> LocalModel:
        """A Gauss-Newton model with this part, made positive definite."""
        return LocalModel(model.slope, _positive(model.curvature, self.part)) if self.part.any() else model

    def learn(self, before: LocalModel, after: LocalModel, step: Array, gained: float) -> None:
        """From a step (n,) that gained so much, with the Gauss-Newton models before and after it."""
        self.leads = abs(self.augmented(before).promised(step) - gained) < abs(before.promised(step) - gained)
        updated = _updated(self.part, after.curvature, step, before.slope - after.slope)
        self.part = updated if np.isfinite(updated).all() else self.part


def _updated(part: Array, curvature: Array, step: Array, fall: Array) -> Array:
    """The second-order ``part`` (n,n) beside ``curvature`` (n,n) after a step (n,) in which the slope fell by ``fall``
    (n,): sized to what the step shows, and the least change of it that agrees with the step."""
    beyond, along = fall - curvature @ step, float(step @ fall)
    if not along > STEEPEST * float(step @ curvature @ step):
        return part
    known = float(step @ part @ step)
    sized = part * min(1.0, abs(float(step @ beyond)) / abs(known)) if known else part
    wrong = beyond - sized @ step
    mixed = np.outer(wrong, fall)
    return np.asarray(sized + (mixed + mixed.T) / along - float(step @ wrong) * np.outer(fall, fall) / along**2)


def _positive(curvature: Array, part: Array) -> Array:
    """The sum of both (n,n), made positive definite in units of their diagonals."""
    root = np.sqrt(np.maximum(np.diag(curvature) + np.abs(np.diag(part)), TINY))
    scale = root[:, None] * root
    size, vector = np.linalg.eigh((curvature + part) / scale)
    return np.asarray((vector * np.maximum(size, LEAST_CURVATURE)) @ vector.T * scale)


def _downhill(
    total: Cost,
    begun: tuple[Array, float],
    model: LocalModel,
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
        if 0 < promised < tolerance:
            break
        damping = max(damping * 20, 1e-4)
    return value, lowest, damping


def bounded_step(model: LocalModel, value: Array, low: Array, high: Array, damping: float) -> Array:
    """Damped Newton step (n,) within bounds (n,), which keeps variables where they lean on a bound (projected Newton,
    Bertsekas, SIAM J. Control Optim. 20 (1982) 221); those that would go beyond one go to it, and the others know."""
    root = np.sqrt(np.maximum(np.diag(model.curvature), TINY))
    at_low, at_high = (value <= low) & (model.slope < 0), (value >= high) & (model.slope > 0)
    step = np.where(at_low, low - value, np.where(at_high, high - value, 0.0))
    free = ~(at_low | at_high)
    while free.any():
        index = np.flatnonzero(free)
        slope = model.slope[index] - model.curvature[np.ix_(index, ~free)] @ step[~free]
        matrix = model.curvature[np.ix_(index, index)] / root[index, None] / root[index] + damping * np.eye(len(index))
        step[index] = np.linalg.lstsq(matrix, slope / root[index], rcond=1e-12)[0] / root[index]
        # One at a time: what several together would go beyond the others may need no more once the first is held.
        beyond = np.where(free, root * np.maximum(low - value - step, value + step - high), -np.inf)
        worst = int(beyond.argmax())
        if beyond[worst] <= 0:
            break
        step[worst] = (high if step[worst] > 0 else low)[worst] - value[worst]
        free[worst] = False
    return step
