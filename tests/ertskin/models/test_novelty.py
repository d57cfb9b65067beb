"""Frames unlike those trained on: told, and no more often by mistake than stated; kept with a network."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from ertskin.models.monitor import SkinMonitor
from ertskin.models.novelty import FALSE_ALARMS, Novelty, limits_of, tail_limit, unexplained_of
from ertskin.physics.calibration.following import RestingSkin


def test_a_limit_holds_its_rate_far_beyond_what_was_seen():
    limits = [tail_limit(chi2.rvs(96, size=600, random_state=seed) / 96, 1e-3) for seed in range(20)]
    rates = chi2.sf(96 * np.array(limits), 96)
    assert np.median(rates) == pytest.approx(1e-3, rel=0.8)
    assert rates.max() < 1e-2
    assert tail_limit(np.ones(20), 1e-3) == np.inf


def test_no_kind_of_frame_is_beyond_more_often_than_stated():
    rng = np.random.default_rng(0)
    quiet, loud = rng.chisquare(20, 500) / 20, rng.chisquare(10, 500) / 10
    limits = limits_of([quiet, loud], [quiet], [np.zeros(5)])
    assert limits[0] == tail_limit(loud, FALSE_ALARMS / 3)
    assert limits[1] < limits[0]
    assert limits[2] == np.inf


@pytest.fixture(scope="module")
def novelty() -> Novelty:
    """Trials along eight of twenty directions, noise of one millivolt."""
    rng = np.random.default_rng(1)
    trials = np.zeros((2000, 20))
    trials[:, :8] = 0.05 * rng.standard_normal((2000, 8))
    noisy = trials + 1e-3 * rng.standard_normal(trials.shape)
    found = Novelty.of_trials(trials, 1e-6 * np.eye(20), noisy[:500], 1e-3)
    parts = found.parts(noisy, None, None).T
    unexplained = unexplained_of(1e-3 * rng.standard_normal((2000, 40)), 1e-3, 40, 1000)
    limits = limits_of([parts[0]], [parts[1]], [unexplained])
    return Novelty(found.matrix, found.power, found.remainder, found.noise_v, limits)


def test_strange_frames_are_distinguished_from_trained_ones(novelty):
    rng = np.random.default_rng(2)
    usual = np.zeros((3000, 20))
    usual[:, :8] = 0.05 * rng.standard_normal((3000, 8))
    usual += 1e-3 * rng.standard_normal(usual.shape)
    leftover = 1e-3 * rng.standard_normal((3000, 40))
    unexplained = unexplained_of(leftover, 1e-3, 40, 1000)
    score = novelty.score(usual, None, unexplained)
    assert (score > 1.0).mean() <= 4e-3
    elsewhere = usual[:1] + 0.02 * np.eye(20)[15]
    too_strong = 10.0 * usual[:1]
    broken = unexplained_of(3e-3 * np.ones((1, 40)), 1e-3, 40, 1000)
    assert novelty.score(elsewhere, None, unexplained[:1])[0] > 1.0
    assert novelty.score(too_strong, None, unexplained[:1])[0] > 1.0
    assert novelty.score(usual[:1], None, broken)[0] > 1.0
    spiky = leftover[:1].copy()
    spiky[0, 3] = 1.0
    assert novelty.score(usual[:1], None, unexplained_of(spiky, 1e-3, 40, 1000))[0] < 1.2
    # A zero that is as noisy as the frame doubles what is expected.
    assert novelty.score(elsewhere, None, None, 1.0)[0] == pytest.approx(
        0.5 * novelty.score(elsewhere, None, None, 0.0)[0]
    )


def test_a_monitor_comes_back_from_its_arrays(novelty):
    monitor = SkinMonitor(RestingSkin(np.arange(20.0), np.ones((20, 3)), 1e-3, jitter=0.02, limit=1.2), novelty)
    again = SkinMonitor.of(monitor.held())
    assert again is not None
    assert again.resting.jitter == 0.02
    assert again.resting.limit == 1.2
    np.testing.assert_array_equal(again.novelty.limits, novelty.limits)
    assert SkinMonitor.of({}) is None
