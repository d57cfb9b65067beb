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
from scipy.optimize import nnls

Array = NDArray[np.float64]

TRIES = 8
"""Ever more damped steps that are tried."""
TINY = 1e-300
LEAST_CURVATURE = 1e-9
"""Of a direction along which the augmented model would curve downwards, in units of its own diagonal."""
RANK = 1e-12
"""Part of the largest curvature, in units of the diagonal, below which a direction isn't known."""
ROUNDING = 1e-9
"""Of a step in units of the diagonal, by which an inequality may be broken."""
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


@dataclass(frozen=True, eq=False)
class Inequalities:
    """What values (n,) must fulfil: ``rows`` (k,n) times them is at least ``least`` (k,)."""

    rows: Array
    least: Array


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
    inequalities: Inequalities | None = None,
) -> Fit:
    """Minimise cost(x) + prior within bounds; ``cost`` and ``linearise`` are half chi-squares.

    A step goes along what of the ``inequalities`` it would break. Where ``cost`` is infinite without one that says so,
    damping alone keeps from there, and the descent may come to rest where that begins.

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
        value, reached, damping = _downhill(
            total, (value, lowest), leading, (*bounds, inequalities), damping, tolerance
        )
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
    within: tuple[Array, Array, Inequalities | None],
    damping: float,
    tolerance: float,
) -> tuple[Array, float, float]:
    """Where the first of ever more damped steps from a point and its cost comes down to, the cost, the damping next.

    The point itself where none comes down, or what the step promises is less than ``tolerance``.
    """
    (value, lowest), (low, high, inequalities) = begun, within
    for _ in range(TRIES):
        step = bounded_step(model, value, low, high, damping, inequalities)
        if not np.isfinite(step).all():
            break
        trial = np.clip(value + step, low, high)
        promised = model.promised(trial - value)
        # A step that a bound cuts short may lead uphill.
        trial_cost = total(trial) if promised > 0 else np.inf
        if trial_cost < lowest:
            return trial, trial_cost, max(damping / 10, 1e-9)
        if 0 < promised < tolerance:
            break
        damping = max(damping * 20, 1e-4)
    return value, lowest, damping


def bounded_step(
    model: LocalModel, value: Array, low: Array, high: Array, damping: float, inequalities: Inequalities | None = None
) -> Array:
    """The damped Newton step (n,) that promises most of those within bounds (n,) and inequalities; none, where there
    is no such step."""
    free = low < high
    step = np.where(free, 0.0, low - value)
    diagonal = np.diag(model.curvature)[free]
    root = np.sqrt(np.where(diagonal > TINY, diagonal, 1.0))
    matrix = model.curvature[np.ix_(free, free)] / root[:, None] / root + damping * np.eye(len(root))
    slope = (model.slope[free] - model.curvature[np.ix_(free, ~free)] @ step[~free]) / root
    # Both bounds, as inequalities of the scaled step, and the others.
    within = np.eye(len(root))
    rows, least = [within, -within], [root * (low - value)[free], root * (value - high)[free]]
    if inequalities is not None:
        scaled = inequalities.rows[:, free] / root
        size = np.maximum(np.linalg.norm(scaled, axis=1), TINY)
        rows.append(scaled / size[:, None])
        least.append((inequalities.least - inequalities.rows @ (value + step)) / size)
    step[free] = _best_within(matrix, slope, np.concatenate(rows), np.concatenate(least)) / root
    return step


def _best_within(matrix: Array, slope: Array, rows: Array, least: Array) -> Array:
    """The step s (n,) of largest slope.s - s'matrix s/2 with rows (k,n) times s at least ``least`` (k,); 0 if none is.

    Of the rows those come in that a step without them would break.
    """
    size, vector = np.linalg.eigh(matrix)
    shown = size > RANK * size[-1]
    white = vector[:, shown] / np.sqrt(size[shown])
    free, asked = white.T @ slope, np.zeros(len(least), dtype=bool)
    step = white @ free
    while True:
        broken = ~asked & (rows @ step < least - ROUNDING)
        if not broken.any():
            return np.asarray(step)
        asked |= broken
        nearest = _nearest(free, rows[asked] @ white, least[asked])
        if nearest is None:
            return np.zeros(len(slope))
        step = white @ nearest


def _nearest(point: Array, rows: Array, least: Array) -> Array | None:
    """The y (n,) nearest to a point with rows (k,n) times y at least ``least`` (k,); None where there is none.

    Least distance programming (Lawson & Hanson, Solving Least Squares Problems (1974), ch. 23) by way of nnls.
    """
    short = least - rows @ point
    unit = max(float(np.abs(short).max()), TINY)
    dual = np.vstack([rows.T, short / unit])
    goal = np.zeros(len(dual))
    goal[-1] = 1.0
    rest = dual @ nnls(dual, goal)[0] - goal
    return np.asarray(point - unit * rest[:-1] / rest[-1]) if rest[-1] < -RANK else None
