"""Channels that repeat their last readings: found where they do, and nowhere else."""

from __future__ import annotations

import numpy as np

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.recording.repeating_channels import repeating

FRAMES, INJECTIONS, CHANNELS = 20, 40, 6


def readings(step_v: float = 1e-4, noise_v: float = 2e-3) -> np.ndarray:
    """(T,K,M) noisy readings in whole steps; the first injection's are tied to ground."""
    rng = np.random.default_rng(0)
    voltage = 1.0 + rng.random((INJECTIONS, CHANNELS)) + noise_v * rng.standard_normal((FRAMES, INJECTIONS, CHANNELS))
    voltage[:, 0] = 0.0
    return np.asarray(np.round(voltage / step_v) * step_v)


def test_a_channel_that_freezes_is_found_while_it_does() -> None:
    voltage = readings()
    voltage[7:10, :, 2] = voltage[6, :, 2]
    voltage[9, 3, 2] = np.nan
    found = repeating(voltage, DEFAULT)
    assert found.sum() == 3
    assert found[7:10, 2].all()


def test_a_dead_channel_repeats_from_the_first_frame_on() -> None:
    voltage = readings()
    voltage[..., 4] = 0.3
    found = repeating(voltage, DEFAULT)
    assert found[:, 4].all()
    assert found.sum() == FRAMES
    voltage[11] = voltage[10]
    assert repeating(voltage, DEFAULT)[:, 4].all()


def test_a_frame_without_readings_hides_no_repeat() -> None:
    voltage = readings()
    voltage[..., 4] = 0.3
    voltage[7:10, :, 2] = voltage[6, :, 2]
    voltage[[1, 8]] = np.nan
    found = repeating(voltage, DEFAULT)
    assert found[:, 4].all()
    assert found[[7, 9], 2].all()
    assert found[:, 2].sum() == 2


def test_half_of_the_channels_may_freeze_together() -> None:
    voltage = readings()
    voltage[7:10, :, :3] = voltage[6, :, :3]
    found = repeating(voltage, DEFAULT)
    assert found[7:10, :3].all()
    assert found.sum() == 9


def test_a_quiet_channel_on_a_coarse_converter_is_alike_by_chance() -> None:
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((400, 16, 16)) * np.where(np.arange(16) == 3, 0.2, 1.0)
    assert not repeating(np.round(rng.random((16, 16)) * 50 + noise), DEFAULT).any()


def test_one_frame_repeats_nothing() -> None:
    assert repeating(readings()[:1], DEFAULT).shape == (1, CHANNELS)


def test_frames_in_which_nothing_moves_may_be_alike() -> None:
    rng = np.random.default_rng(1)
    moving = np.arange(120) // 5 % 2
    steps = 5000 + rng.integers(0, 4, (120, 276, 24)) * moving[:, None, None]
    assert not repeating(np.round(steps + 0.01 * rng.standard_normal(steps.shape)) * 1e-4, DEFAULT).any()


def test_neither_coarse_steps_nor_frames_written_twice_nor_silence_are_frozen_channels() -> None:
    assert not repeating(readings(step_v=5e-2), DEFAULT).any()
    twice = readings()
    twice[11] = twice[10]
    assert not repeating(twice, DEFAULT).any()
    assert not repeating(readings(noise_v=0.0), DEFAULT).any()
    assert not repeating(np.full((FRAMES, INJECTIONS, CHANNELS), np.nan), DEFAULT).any()
