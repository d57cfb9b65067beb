"""Share of two-point frames with both contacts found and nothing else (paper Fig. 11: 11 of 14)."""

from __future__ import annotations

from ertskin.evaluation.metrics.hit_rate_one import exact_share
from ertskin.evaluation.metrics.score import Score, scored
from ertskin.evaluation.outcome import Outcome


def exact_rate_two(outcome: Outcome) -> Score:
    """Exact rate, 0 to 1, over the frames with two contacts; a trial counts for both its taxels."""
    return scored("exact_rate_two", exact_share, outcome.with_contacts(2))
