"""The e-skin study's parts: nothing held out is learned from, and both learners learn."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

STUDY = Path(__file__).resolve().parents[2] / "experiments" / "real" / "eskin"


@pytest.fixture(scope="module")
def study():
    """The study's modules, which live outside any package."""
    sys.path.insert(0, str(STUDY))
    import kernel_ridge
    import location_network
    import touches

    yield kernel_ridge, location_network, touches
    sys.path.remove(str(STUDY))


def made_up(touches, count: int = 1500):
    """Touches on a disk, read by 24 channels that fall off with distance."""
    rng = np.random.default_rng(0)
    angle, radius = 2 * np.pi * rng.random(count), 40 * np.sqrt(rng.random(count))
    place_mm = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    channel_mm = 50 * np.stack([np.cos(np.arange(24)), np.sin(np.arange(24))], axis=1)
    away_mm = np.linalg.norm(place_mm[:, None] - channel_mm, axis=-1)
    strength = rng.uniform(0.7, 1.3, (count, 1))
    return touches.SkinTouches(
        1e3 * strength * np.exp(-away_mm / 30) + 5 * rng.standard_normal(away_mm.shape), place_mm
    )


def test_the_last_touches_are_never_tuned_on(study):
    _, _, touches = study
    made = made_up(touches)
    used = np.concatenate([np.concatenate(fold) for fold in made.tuning_folds()])
    assert made.held_out[0] == 1000
    assert used.max() < made.held_out[0]
    assert all(train.max() < test.min() for train, test in made.tuning_folds())


def test_hit_rate_counts_the_cells_of_the_early_touches(study):
    _, _, touches = study
    made = made_up(touches)
    truth_mm = made.place_mm[made.held_out]
    assert touches.hit_rate(truth_mm, made, made.held_out) == 1.0
    pitch_mm = np.ptp(made.place_mm[made.early], axis=0) / touches.GRID
    inner = np.abs(truth_mm[:, 0]) < 20
    assert touches.hit_rate((truth_mm + np.array([pitch_mm[0], 0.0]))[inner], made, made.held_out[inner]) == 0.0


def test_kernel_ridge_is_sklearns(study):
    from sklearn.kernel_ridge import KernelRidge

    kernel_ridge, _, touches = study
    made = made_up(touches, 700)
    setting = kernel_ridge.Setting(100.0, "standardised", "gaussian", 1.0, 0.1)
    early, late = (np.arcsinh(made.response[rows] / 100.0) for rows in (made.early, made.held_out))
    mean, spread = early.mean(axis=0), early.std(axis=0)
    early, late = (early - mean) / spread, (late - mean) / spread
    middle = np.median(np.linalg.norm(early[:, None] - early, axis=-1))
    centre_mm = made.place_mm[made.early].mean(axis=0)
    theirs = KernelRidge(alpha=0.1, kernel="rbf", gamma=0.5 / middle**2).fit(
        early, made.place_mm[made.early] - centre_mm
    )
    np.testing.assert_allclose(kernel_ridge.predict(made, setting), theirs.predict(late) + centre_mm, atol=1e-6)


def test_the_network_learns_and_repeats_itself(study):
    _, location_network, touches = study
    made = made_up(touches)
    settings = location_network.Settings(members=2, width=64, epochs=30)

    def said_mm(seed: int) -> np.ndarray:
        return location_network.fit_predict(
            made.response[made.early], made.place_mm[made.early], made.response[made.held_out], settings, seed
        )

    first = said_mm(0)
    truth_mm = made.place_mm[made.held_out]
    guessing_mm = touches.errors_mm(made.place_mm[made.early].mean(axis=0), truth_mm).mean()
    assert touches.errors_mm(first, truth_mm).mean() < 0.15 * guessing_mm
    np.testing.assert_array_equal(first, said_mm(0))
    assert not np.array_equal(first, said_mm(1))


def test_a_network_started_from_another_skins_needs_fewer_touches(study):
    _, location_network, touches = study
    made = made_up(touches)
    settings = location_network.Settings(members=1, epochs=40, width=64)
    source = location_network.fitted(made.response[made.early], made.place_mm[made.early], settings, 0)
    other = touches.SkinTouches(1.4 * made.response + 30.0, made.place_mm)
    some = made.early[:128]
    few = location_network.Settings(members=1, epochs=5, width=64)
    errors = [
        touches.errors_mm(
            location_network.fitted(other.response[some], other.place_mm[some], few, 0, start).places_mm(
                other.response[other.held_out]
            ),
            other.place_mm[other.held_out],
        ).mean()
        for start in (None, source)
    ]
    assert errors[1] < 0.5 * errors[0]
