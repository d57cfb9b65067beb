"""One metric's value over all frames and over those that touch each taxel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.evaluation.outcome import Outcome

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Score:
    """``value`` over all frames; ``per_taxel`` (n,) over the frames touching each taxel, NaN where none did."""

    name: str
    value: float
    per_taxel: Array

    @property
    def taxel_mean(self) -> float:
        """Mean over the taxels touched; NaN where there are none."""
        known = self.per_taxel[np.isfinite(self.per_taxel)]
        return float(known.mean()) if known.size else float("nan")

    @property
    def taxel_spread(self) -> float:
        """Standard deviation over the taxels touched: what follows the paper's ±."""
        known = self.per_taxel[np.isfinite(self.per_taxel)]
        return float(known.std()) if known.size else float("nan")


def scored(name: str, statistic: Callable[[Outcome], float], outcome: Outcome) -> Score:
    """``statistic`` over all frames and again over the frames touching each taxel; NaN for no frames."""
    parts = [outcome[column] for column in outcome.touched.T]
    per_taxel = np.array([statistic(part) if len(part.map_n) else np.nan for part in parts])
    return Score(name, statistic(outcome) if len(outcome.map_n) else float("nan"), per_taxel)


def scored_contacts(name: str, statistic: Callable[[Array], float], error: Array, outcome: Outcome) -> Score:
    """``statistic`` of a per-contact error (N,n), read at the touched taxels, over all contacts and per taxel."""
    touched = outcome.touched
    per_taxel = np.array(
        [statistic(error[column, taxel]) if column.any() else np.nan for taxel, column in enumerate(touched.T)]
    )
    return Score(name, statistic(error[touched]) if touched.any() else float("nan"), per_taxel)
