"""Touches of a recording whose skin drifts, as they would have read at the calibration."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.data.touches import followed_touches, touches_of
from ertskin.errors import UserError
from ertskin.evaluation.followed import in_words
from ertskin.hardware.recording import Frames, Recording
from ertskin.physics.calibration.following import RestingSkin
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol, electrode_pairs

PROTOCOL = Protocol.against_sink(electrode_pairs(8), 8, 1e-4)
NOISE_V = 1e-3


def drifting(sheet: np.ndarray, seed: int = 0) -> tuple[Recording, RestingSkin, np.ndarray]:
    """A press between any two rest frames, contact and sheet drifting; the calibrated skin, and its press (n,)."""
    rng = np.random.default_rng(seed)
    slope_v, rest_v, press_v = 0.5 * rng.standard_normal((28, 2)), rng.standard_normal(28), rng.standard_normal(28)
    count = len(sheet)
    pressed = np.arange(count) % 2 == 1
    change = np.column_stack([np.linspace(0.0, 0.1, count), sheet])
    coordinates = rest_v + change @ slope_v.T + (pressed * (1.0 + sheet))[:, None] * press_v
    readings = coordinates @ PROTOCOL.orthonormal.T + NOISE_V * rng.standard_normal((count, 224))
    place = np.where(pressed[:, None, None], 0.05, np.nan) * np.ones((1, 1, 2))
    force = np.where(pressed, 2.0, np.nan)[:, None]
    phase = np.where(pressed, 2, 0).astype(np.uint8)
    history = History(10.0 * np.arange(count), np.arange(count) // 2, phase, place, np.full((count, 1), np.nan), force)
    frames = Frames(readings.reshape(-1, 28, 8).astype(np.float32), history)
    return Recording("r", "", "", None, PROTOCOL, frames), RestingSkin(rest_v, slope_v, NOISE_V, limit=2.0), press_v


def test_changes_are_those_of_the_calibrated_skin():
    recording, skin, press_v = drifting(np.linspace(0.0, 0.1, 60))
    zeroed, (touches, course) = touches_of(recording), followed_touches(recording, skin)
    errors = [np.linalg.norm(each.change_v[-10:] - press_v, axis=1).mean() for each in (zeroed, touches)]
    assert errors[0] > 0.08 * np.linalg.norm(press_v)
    assert errors[1] < 0.01 * np.linalg.norm(press_v)
    raw = touches.readings_v.astype(float) @ PROTOCOL.orthonormal
    np.testing.assert_allclose(raw, touches.change_v, atol=10 * NOISE_V)
    assert course.sheet == pytest.approx(0.1, abs=5e-3)
    assert course.contact == pytest.approx(0.1, abs=1e-2)
    assert (course.frames, touches.rest_frames) == (30, 30)
    assert "sheet has changed by" in in_words(course)


def test_a_rest_frame_that_fits_no_longer_is_counted():
    recording, skin, _ = drifting(np.zeros(40))
    assert recording.frames is not None
    recording.frames.voltage_v[20] += PROTOCOL.orthonormal[:, 3].reshape(28, 8).astype(np.float32) * 0.5
    _, course = followed_touches(recording, skin)
    assert course.strange >= 1


def test_another_scan_is_refused():
    recording, *_ = drifting(np.zeros(4))
    other = RestingSkin(np.zeros(5), np.zeros((5, 0)), 1.0)
    with pytest.raises(UserError, match="another protocol"):
        followed_touches(recording, other)
