"""Root mean square error of the force at the touched taxel, one contact (paper Fig. 10 b)."""

from __future__ import annotations

import numpy as np

from ertskin.evaluation.metrics.score import Array, Score, scored_contacts
from ertskin.evaluation.outcome import Outcome


def _root_mean_square(error_n: Array) -> float:
    return float(np.sqrt(np.mean(error_n**2)))


def force_rmse_one_n(outcome: Outcome) -> Score:
    """RMSE in newton between the true force and the estimate at the touched taxel; a missed contact estimates 0 N.

    Force declared at other taxels isn't credited: a touch put at the wrong place is an error of its whole force.
    """
    one = outcome.with_contacts(1)
    error_n = one.believed_map_n - one.true_map_n
    return scored_contacts("force_rmse_one_n", _root_mean_square, error_n, one)
