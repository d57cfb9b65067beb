"""Pearson correlation of estimated and true force, one contact (paper: 0.95)."""

from __future__ import annotations

import numpy as np

from ertskin.evaluation.metrics.score import Score, scored
from ertskin.evaluation.outcome import Outcome


def _correlation(outcome: Outcome) -> float:
    truth = outcome.true_map_n[outcome.touched]
    estimate = outcome.believed_map_n[outcome.touched]
    if len(truth) < 2 or np.ptp(truth) == 0 or np.ptp(estimate) == 0:
        return float("nan")
    return float(np.corrcoef(truth, estimate)[0, 1])


def force_correlation_one(outcome: Outcome) -> Score:
    """Correlation, -1 to 1, at the touched taxels of one-point frames; NaN where either side never varies."""
    return scored("force_correlation_one", _correlation, outcome.with_contacts(1))
