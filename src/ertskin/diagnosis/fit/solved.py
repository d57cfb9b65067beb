"""A joint fit that was solved: its best values, how well they are known, what it loses without a term."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.bounded_step import Region, bounded_step
from ertskin.diagnosis.fit.levenberg_marquardt import Fit
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.linear.calibration_vector import Calibration
from ertskin.physics.effects.effect import Effect

Array = NDArray[np.float64]

LEAST_DAMPING = 1e-9
"""Of a step without a term, or without some cells, so that numbers the data hardly tell may go along a bound."""


@dataclass(frozen=True, eq=False)
class Solved:
    """A joint fit: its terms at their best values, the calibration, the quadratic about it.

    ``scan_residual`` (T,P) in units of the noise; parameters in the order calibration, then the terms' free ones.
    ``leftover``: whether what no resistor network explains is counted in the cost, too.
    """

    calibration: Calibration
    terms: tuple[Term, ...]
    fit: Fit
    scan_residual: Array
    leftover: bool = False

    @property
    def effects(self) -> tuple[Effect, ...]:
        return tuple(t.effect for t in self.terms)

    @property
    def cost(self) -> float:
        """Half chi-square over everything."""
        return float(self.fit.quadratic.cost.sum())

    def first(self, term: int) -> int:
        """Which of the fit's numbers is a term's first."""
        return len(self.fit.value) - sum(t.count for t in self.terms[term:])

    def sizes(self, term: int) -> slice:
        """Which of the fit's numbers are the sizes of a term's field."""
        first = self.first(term)
        return slice(first + len(self.terms[term].free), first + self.terms[term].count)

    def rise_without(self, term: int, *, others_stay: bool = False) -> float:
        """Half chi-square and prior that are lost without a term, by the local model: its defining numbers neutral, its
        others and a field's sizes kept. ``others_stay``: only the calibration makes up for it, no other term does."""
        region = self.fit.region or Region.everywhere(len(self.fit.value))
        low, high = region.low.copy(), region.high.copy()
        first, kept = self.first(term), self.terms[term]
        held = slice(self.first(0), None) if others_stay else slice(first, first + kept.count)
        low[held] = high[held] = self.fit.value[held]
        for number, key in enumerate(kept.free, first):
            if kept.effect.known(key).defining:
                low[number] = high[number] = kept.effect.known(key).neutral
        model = self.fit.local_model
        without = replace(region, low=low, high=high)
        return -model.promised(bounded_step(model, self.fit.value, without, damping=LEAST_DAMPING))

    def known(self, term: int, key: str) -> tuple[float, float]:
        """A free parameter's value and its standard error.

        The error is that of white residuals of their size, or the folds' if they pull the value about by more.
        """
        position = self.first(term) + self.terms[term].free.index(key)
        inflation = max(1.0, float((self.scan_residual**2).mean()))
        white = inflation * self.fit.covariance[position, position]
        error = float(np.sqrt(max(white, self.fit.robust_covariance[position, position], 0.0)))
        return self.terms[term].effect.value(key), error
