"""Share of one-point frames in which the set of taxels declared equals the true one (paper Fig. 10 a)."""

from __future__ import annotations

from ertskin.evaluation.metrics.score import Score, scored
from ertskin.evaluation.outcome import Outcome


def exact_share(outcome: Outcome) -> float:
    """Share of frames, 0 to 1, whose declared taxels are exactly the touched ones: no ghost, no miss."""
    return float((outcome.present == outcome.touched).all(axis=1).mean())


def hit_rate_one(outcome: Outcome) -> Score:
    """Hit rate, 0 to 1, over the frames with one contact."""
    return scored("hit_rate_one", exact_share, outcome.with_contacts(1))
