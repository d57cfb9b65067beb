"""Half chi-squares near a point, by fold and as a whole."""

from __future__ import annotations

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
