"""The resting mean through spikes, drift and broken frames."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.physics.calibration.rest_frames import rest_scan
from ertskin.physics.protocol import Protocol


@pytest.fixture
def frames(protocol: Protocol) -> np.ndarray:
    rng = np.random.default_rng(0)
    pairs = 2e4 + 1e3 * rng.standard_normal(28)
    return protocol.readings(pairs) + 2e-3 * rng.standard_normal((40, *protocol.shape))


def test_mean_and_noise_of_clean_frames(frames: np.ndarray, protocol: Protocol):
    scan = rest_scan(frames, protocol)
    assert scan.voltage_v == pytest.approx(frames.mean(axis=0), abs=1e-3)
    assert scan.noise_v == pytest.approx(2e-3, rel=0.05)
    assert scan.scatter_v == pytest.approx(2e-3, rel=0.1)
    assert scan.nonreciprocal_v == pytest.approx(2e-3 / np.sqrt(40), rel=0.2)


def test_spikes_are_bent_down(frames: np.ndarray, protocol: Protocol):
    spiked = frames.copy()
    where = np.random.default_rng(1).random(spiked.shape) < 0.01
    spiked[where] += 1.0
    error = np.abs(rest_scan(spiked, protocol).voltage_v - frames.mean(axis=0)).max()
    assert error < 0.02 < np.abs(spiked.mean(axis=0) - frames.mean(axis=0)).max()
    assert rest_scan(spiked, protocol).noise_v == pytest.approx(2e-3, rel=0.1)


def test_a_drifting_skin_is_not_noise_of_the_reader(frames: np.ndarray, protocol: Protocol):
    gain = 1 + 0.01 * np.random.default_rng(2).standard_normal(40)
    drifting = frames * gain[:, None, None]
    scan = rest_scan(drifting, protocol)
    assert scan.noise_v == pytest.approx(2e-3, rel=0.1)
    assert scan.scatter_v > 2 * scan.noise_v


def test_lost_readings_come_from_the_others_and_broken_frames_are_left_out(frames: np.ndarray, protocol: Protocol):
    broken = frames.copy()
    broken[7, 0, 2] = np.nan
    whole = rest_scan(broken, protocol)
    assert whole.frames == 40
    assert whole.voltage_v == pytest.approx(rest_scan(frames, protocol).voltage_v, abs=1e-3)
    broken[9, 1:] = np.nan
    assert rest_scan(broken, protocol).frames == 39
    with pytest.raises(ValueError, match="no complete rest frame"):
        rest_scan(np.full_like(frames, np.nan), protocol)
