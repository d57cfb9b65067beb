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

from ertskin.diagnosis.fit.bounded_step import Region, bounded_step
from ertskin.diagnosis.fit.quadratic import LocalModel, Quadratic

Array = NDArray[np.float64]

TRIES = 8
"""Ever more damped steps that are tried."""
TINY = 1e-300
BEGUN = 4
"""Steps after which a hopeless descent is seen to be one."""
LEAST_CURVATURE = 1e-9
"""Of a direction along which the augmented model would curve downwards, in units of its own diagonal."""
STEEPEST = 1e-8
"""Part of a step's Gauss-Newton curvature that its secant must have at least to be believed."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Where the descent ended: values (n,), the quadratic there (prior not included), the prior's Hessian and mean, and
    the region it went in (all, if None)."""

    value: Array
    quadratic: Quadratic
    prior: Array
    steps: int
    prior_mean: Array | float = 0.0
    region: Region | None = None

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
    region: Region,
    prior_mean: Array,
    prior_precision: Array,
    *,
    steps: int = 12,
    tolerance: float = 0.05,
    longest: Array | float = np.inf,
    secants: bool = True,
    hopeless: float = np.inf,
) -> Fit:
    """Minimise cost(x) + prior in a region; ``cost`` and ``linearise`` are half chi-squares.

    Stops when a step gains less than ``tolerance``, or ``BEGUN`` steps end above ``hopeless``. None is longer than
    ``longest`` (n,): what the data hardly tell of would be taken to where nothing is as linearised. Where ``cost`` is
    infinite, and the region doesn't say so, damping alone keeps from there. ``secants`` need its true gradient.
    """
    value, prior = region.clip(start), np.diag(prior_precision)
    region = region.with_in_it(value)
    total = _with_prior(cost, prior_mean, prior_precision)
    lowest, damping, taken = total(value), 1e-6, 0
    quadratic = linearise(value)
    model, second = LocalModel.of(quadratic, prior, value - prior_mean), _SecondOrder(np.zeros_like(prior))
    for taken in range(1, steps + 1):
        begun, within = value, region.near(value, longest)
        leading = second.augmented(model) if second.leads else model
        value, reached, damping = _downhill(total, (value, lowest), leading, within, damping, tolerance)
        gained, lowest = lowest - reached, reached
        if not gained > 0:
            break
        quadratic = linearise(value)
        if gained < tolerance or (taken == BEGUN and lowest > hopeless):
            break
        before, model = model, LocalModel.of(quadratic, prior, value - prior_mean)
        if secants:
            second.learn(before, model, value - begun, gained)
    return Fit(value, quadratic, prior, taken, prior_mean, region)


@dataclass(eq=False)
class _SecondOrder:
    """The part (n,n) of a cost's Hessian that Gauss-Newton leaves out, as secants tell it.

    ``leads``: whether the model augmented by it predicted the last step's gain better than Gauss-Newton's, and makes
    the next step.
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
    region: Region,
    damping: float,
    tolerance: float,
) -> tuple[Array, float, float]:
    """Where the first of ever more damped steps from a point and its cost comes down to, the cost, the damping next.

    The point itself where none comes down, or what the step promises is less than ``tolerance``.
    """
    value, lowest = begun
    for _ in range(TRIES):
        step = bounded_step(model, value, region, damping)
        if not np.isfinite(step).all():
            break
        trial = region.clip(value + step)
        promised = model.promised(trial - value)
        # Where no step leads along the region's border none is promised anything.
        trial_cost = total(trial) if promised > 0 else np.inf
        if trial_cost < lowest:
            return trial, trial_cost, max(damping / 10, 1e-9)
        if 0 < promised < tolerance:
            break
        damping = max(damping * 20, 1e-4)
    return value, lowest, damping
