"""The Newton step of a local model that stays within bounds and linear inequalities: a convex quadratic program."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from ertskin.diagnosis.fit.quadratic import LocalModel

Array = NDArray[np.float64]

TINY = 1e-300
RANK = 1e-12
"""Part of the largest curvature, in units of the diagonal, below which a direction isn't known."""
ROUNDING = 1e-9
"""Of a step in units of the diagonal, by which an inequality may be broken."""


@dataclass(frozen=True, eq=False)
class Inequalities:
    """What values (n,) must fulfil: ``rows`` (k,n) times them is at least ``least`` (k,)."""

    rows: Array
    least: Array


@dataclass(frozen=True, eq=False)
class Region:
    """Where values (n,) may lie: between ``low`` and ``high`` (n,), and where ``inequalities`` hold."""

    low: Array
    high: Array
    inequalities: Inequalities | None = None

    def clip(self, value: Array) -> Array:
        """Values (n,) taken within the bounds."""
        return np.clip(value, self.low, self.high)

    def near(self, value: Array, reach: Array | float) -> Region:
        """The part of it no further than ``reach`` (n,) from ``value`` (n,)."""
        return replace(self, low=np.maximum(self.low, value - reach), high=np.minimum(self.high, value + reach))


def bounded_step(model: LocalModel, value: Array, region: Region, damping: float) -> Array:
    """The damped Newton step (n,) from ``value`` that promises most of those that stay in a region; none, where no
    step leads there."""
    low, high = region.low - value, region.high - value
    free = low < high
    step = np.where(free, 0.0, low)
    diagonal = np.diag(model.curvature)[free]
    root = np.sqrt(np.where(diagonal > TINY, diagonal, 1.0))
    matrix = model.curvature[np.ix_(free, free)] / root[:, None] / root + damping * np.eye(len(root))
    slope = (model.slope[free] - model.curvature[np.ix_(free, ~free)] @ step[~free]) / root
    unit = np.eye(len(root))
    rows, least = [unit, -unit], [root * low[free], -root * high[free]]
    if region.inequalities is not None:
        scaled = region.inequalities.rows[:, free] / root
        size = np.maximum(np.linalg.norm(scaled, axis=1), TINY)
        rows.append(scaled / size[:, None])
        least.append((region.inequalities.least - region.inequalities.rows @ (value + step)) / size)
    step[free] = _best_within(matrix, slope, np.concatenate(rows), np.concatenate(least)) / root
    return step


def _best_within(matrix: Array, slope: Array, rows: Array, least: Array) -> Array:
    """The step s (n,) of largest slope.s - s'matrix s/2 with rows (k,n) times s at least ``least`` (k,); 0 if none is.

    Of the rows those come in that a step without them would break.
    """
    size, vector = np.linalg.eigh(matrix)
    shown = size > RANK * size.max(initial=0.0)
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
