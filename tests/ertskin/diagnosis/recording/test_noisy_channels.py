"""Channels that scatter more than the others."""

from __future__ import annotations

import numpy as np

from ertskin.diagnosis.recording.noisy_channels import noisy_channels

NOISY = 5


def leftover(seed: int = 0, frames: int = 12) -> np.ndarray:
    return 2e-3 * np.random.default_rng(seed).standard_normal((frames, 23, 24))


def test_channels_that_all_scatter_alike_are_sound() -> None:
    assert not any(noisy_channels(leftover(seed)) for seed in range(20))


def test_burst_noise_of_one_channel_is_seen_and_how_strong_it_is() -> None:
    bursts = leftover()
    high = np.cumsum(np.random.default_rng(1).random((12, 23)) < 0.05, axis=None).reshape(12, 23) % 2
    bursts[..., NOISY] += 6e-3 * high
    found = noisy_channels(bursts)
    assert list(found) == [NOISY]
    assert 1.5 < found[NOISY] < 3.0


def test_a_standing_error_is_no_noise_and_what_was_not_read_says_nothing() -> None:
    standing = leftover()
    standing[..., NOISY] += 0.05
    standing[..., 7] = 0.0
    assert noisy_channels(standing) == {}
    assert noisy_channels(standing[:1]) == {}
