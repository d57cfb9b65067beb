"""How many contacts, where and how hard, by the number there are: touches anywhere, by optimal assignment."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.stats import chi2

from ertskin.evaluation.contact_outcome import ContactOutcome
from ertskin.evaluation.metrics.score import Array, Score

STATED = 0.9
"""Probability of the regions whose coverage is counted."""


def contact_scores(outcome: ContactOutcome) -> dict[str, Score]:
    """Scores by name for each number K of true contacts: ``count_rate_K``, ``location_error_mm_K`` (mean over assigned
    contacts), ``force_error_n_K`` (rms), ``missed_K`` and ``invented_K`` (contacts a frame) and, of a method that says
    how sure it is, ``coverage_K``: how many of its 90 % regions hold the contact."""
    found: dict[str, Score] = {}
    for count in np.unique(outcome.true_count[outcome.true_count > 0]):
        rows = outcome.true_count == count
        said = outcome.said_count[rows]
        scores = [
            _overall(f"count_rate_{count}", float(np.mean(said == count)), outcome),
            _by_place(f"location_error_mm_{count}", outcome.place_error_mm, np.mean, outcome, rows),
            _by_place(f"force_error_n_{count}", outcome.force_error_n, _rms, outcome, rows),
            _overall(f"missed_{count}", float(np.mean(np.maximum(count - said, 0))), outcome),
            _overall(f"invented_{count}", float(np.mean(np.maximum(said - count, 0))), outcome),
        ]
        if outcome.covariance is not None:
            scores.append(_by_place(f"coverage_{count}", _covered(outcome), np.mean, outcome, rows))
        found |= {score.name: score for score in scores}
    return found


def _rms(error: Array) -> float:
    return float(np.sqrt(np.nanmean(error**2)))


def _covered(outcome: ContactOutcome) -> Array:
    """(M,) 1 where the pair's stated region holds the true place and force."""
    assert outcome.covariance is not None
    frame, true, said = outcome.pairs
    error = np.column_stack([outcome.said_m[frame, said] - outcome.true_m[frame, true], outcome.force_error_n])
    solved = np.linalg.solve(outcome.covariance[frame, said], error[..., None])[..., 0]
    return (np.einsum("mk,mk->m", error, solved) <= chi2.ppf(STATED, 3)).astype(float)


def _overall(name: str, value: float, outcome: ContactOutcome) -> Score:
    return Score(name, value, np.full(len(outcome.taxel_m), np.nan))


def _by_place(
    name: str, error: Array, statistic: Callable[[Array], float], outcome: ContactOutcome, rows: Array
) -> Score:
    """A statistic over the pairs of the frames ``rows``, and over those nearest to each taxel."""
    kept = rows[outcome.pairs[0]]
    error, taxel = error[kept], outcome.taxel[kept]
    per_taxel = [
        float(statistic(error[taxel == k])) if (taxel == k).any() else np.nan for k in range(len(outcome.taxel_m))
    ]
    return Score(name, float(statistic(error)) if len(error) else float("nan"), np.array(per_taxel))
