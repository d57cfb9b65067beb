"""Mean force error per contact in two-point frames (paper: 5.0 ± 2.2 N)."""

from __future__ import annotations

import numpy as np

from ertskin.evaluation.metrics.score import Array, Score, scored_contacts
from ertskin.evaluation.outcome import Outcome


def _mean(error_n: Array) -> float:
    return float(error_n.mean())


def force_error_two_n(outcome: Outcome) -> Score:
    """Mean absolute error in newton at each truly touched taxel of two-point frames.

    Each contact counts once; a missed contact estimates 0 N, so it errs by its whole force. Ghosts don't enter here:
    ``exact_rate_two`` counts them.
    """
    two = outcome.with_contacts(2)
    error_n = np.abs(two.believed_map_n - two.true_map_n)
    return scored_contacts("force_error_two_n", _mean, error_n, two)
