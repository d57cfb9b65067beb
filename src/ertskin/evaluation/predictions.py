"""All metrics of one method's estimates, as a plain dictionary."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ertskin.evaluation.metrics import ONE_POINT, TWO_POINT, Score, location_error_mm
from ertskin.evaluation.outcome import Array, Outcome

DEFAULT_THRESHOLD_N = 0.3


def evaluate_predictions(
    true_map_n: Array,
    predicted_map_n: Array,
    taxel_m: Array,
    *,
    threshold_n: float = DEFAULT_THRESHOLD_N,
    present: NDArray[np.bool_] | None = None,
    contact_m: Array | None = None,
    located_m: Array | None = None,
) -> dict[str, Score]:
    """Scores by metric name for force maps (N,n) in newton.

    A taxel counts as declared where ``present`` (N,n) says so; without it, where the estimate exceeds
    ``threshold_n``. Frames with one touched taxel give the one-point metrics, those with two the two-point ones; the
    location error is over all of them. Metrics for which there is no frame are left out.
    """
    declared = predicted_map_n > threshold_n if present is None else present
    return evaluate_outcome(Outcome(true_map_n, predicted_map_n, declared, taxel_m, contact_m, located_m))


def evaluate_outcome(outcome: Outcome) -> dict[str, Score]:
    """Scores by metric name: the one-point metrics over frames with one touched taxel, the two-point ones over two."""
    metrics: tuple[Callable[[Outcome], Score], ...] = ()
    for count, those in ((1, ONE_POINT), (2, TWO_POINT)):
        if (outcome.contacts == count).any():
            metrics += those
    if (outcome.contacts > 0).any():
        metrics += (location_error_mm,)
    return {score.name: score for score in (metric(outcome) for metric in metrics)}


def tuned_threshold_n(true_map_n: Array, predicted_map_n: Array, candidates: int = 60) -> float:
    """The threshold in newton with the most exact frames; of several, the middle one. For data not tested on.

    Searched over ``candidates`` evenly spaced values from 0 to the mean force of a contact.
    """
    touched = true_map_n > 0
    highest = true_map_n[touched].mean() if touched.any() else 1.0
    thresholds = np.linspace(0.0, highest, candidates)
    exact = np.array([((predicted_map_n > level) == touched).all(axis=1).mean() for level in thresholds])
    best = np.flatnonzero(exact == exact.max())
    return float(thresholds[best[len(best) // 2]])


def as_builtins(scores: dict[str, Score]) -> dict[str, dict[str, object]]:
    """Scores as values JSON can hold: ``value``, ``taxel_mean``, ``taxel_spread``, ``per_taxel``; NaN becomes None."""

    def known(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    return {
        name: {
            "value": known(score.value),
            "taxel_mean": known(score.taxel_mean),
            "taxel_spread": known(score.taxel_spread),
            "per_taxel": [known(value) for value in score.per_taxel],
        }
        for name, score in scores.items()
    }
