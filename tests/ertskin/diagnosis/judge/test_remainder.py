"""The nameless model predicts what repeats and leaves chance alone."""

from __future__ import annotations

import numpy as np

from ertskin.diagnosis.judge.remainder import remainder
from ertskin.physics.history import History, Phase


def presses(seed: int) -> History:
    """Twenty presses of eight frames at random places and forces."""
    rng = np.random.default_rng(seed)
    place = np.repeat(rng.uniform(0, 0.12, (20, 2)), 8, axis=0)[:, None]
    force = np.tile([1.0, 2, 3, 4, 4, 3, 2, 1], 20)[:, None]
    phase = np.tile([Phase.LOADING] * 4 + [Phase.HOLD] + [Phase.UNLOADING] * 3, 20).astype(np.uint8)
    return History(0.5 * np.arange(160), np.repeat(np.arange(20), 8), phase, place, 1e-3 * force, force)


def misfit(history: History, rng: np.random.Generator, size: float) -> np.ndarray:
    """Noise, and something that grows with force toward one corner."""
    pattern = np.random.default_rng(0).standard_normal(30)
    strength = size * history.force_n[:, 0] * history.contact_m[:, 0].sum(axis=1) / 0.24
    return strength[:, None] * pattern + rng.standard_normal((len(history), 30))


def test_what_repeats_is_predicted_and_chance_is_not() -> None:
    rng = np.random.default_rng(1)
    seen, other = presses(2), presses(3)
    left = misfit(other, rng, 2.0)
    expected = remainder(seen, misfit(seen, rng, 2.0), other)
    assert np.sqrt(((left - expected) ** 2).mean()) < 1.1 < 2.0 < np.sqrt((left**2).mean())
    noise = misfit(other, rng, 0.0)
    assert np.sqrt(((noise - remainder(seen, misfit(seen, rng, 0.0), other)) ** 2).mean()) < 1.05
