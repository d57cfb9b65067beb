"""The Newton step of a local model that stays within bounds and linear inequalities: a convex quadratic program."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.quadratic import LocalModel
from ertskin.physics.least_distance import nearest_point

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

    @classmethod
    def everywhere(cls, count: int) -> Region:
        """No bounds for ``count`` values."""
        return cls(np.full(count, -np.inf), np.full(count, np.inf))

    def clip(self, value: Array) -> Array:
        """Values (n,) taken within the bounds."""
        return np.clip(value, self.low, self.high)

    def near(self, value: Array, reach: Array | float) -> Region:
        """The part of it no further than ``reach`` (n,) from ``value`` (n,)."""
        return replace(self, low=np.maximum(self.low, value - reach), high=np.minimum(self.high, value + reach))

    def with_in_it(self, value: Array) -> Region:
        """The region whose inequalities ask no more than ``value`` (n,) fulfils: a descent may begin at it."""
        if self.inequalities is None:
            return self
        least = np.minimum(self.inequalities.least, self.inequalities.rows @ value)
        return replace(self, inequalities=replace(self.inequalities, least=least))


def bounded_step(model: LocalModel, value: Array, region: Region, damping: float) -> Array:
    """The damped Newton step (n,) from ``value`` (n,) that promises most of those that stay in a region; numbers whose
    bounds meet go to them. The others stay where no step leads into the region.

    Undamped, directions that the model doesn't know aren't taken, not even to get along a bound.
    """
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
        size = np.linalg.norm(scaled, axis=1)
        asked = size > TINY
        rows.append(scaled[asked] / size[asked, None])
        least.append((region.inequalities.least - region.inequalities.rows @ (value + step))[asked] / size[asked])
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
        nearest = nearest_point(free, rows[asked] @ white, least[asked])
        if nearest is None:
            return np.zeros(len(slope))
        step = white @ nearest
