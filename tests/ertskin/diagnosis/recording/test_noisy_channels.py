"""Channels that scatter more than the others."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.diagnosis.recording.noisy_channels import noisy_channels
from ertskin.physics.protocol import Protocol, electrode_pairs

NOISY = 5
SCAN = Protocol.against_sink(electrode_pairs(8), 8, 1e-4)


def leftover(seed: int = 0, frames: int = 12, scan: Protocol = SCAN) -> np.ndarray:
    """What a network's fit leaves of white noise (frames,K,M)."""
    noise = 2e-3 * np.random.default_rng(seed).standard_normal((frames, scan.orthonormal.shape[0]))
    return (noise - noise @ scan.orthonormal @ scan.orthonormal.T).reshape(frames, *scan.shape)


def test_channels_that_all_scatter_alike_are_sound() -> None:
    assert not any(noisy_channels(leftover(seed), SCAN) for seed in range(20))


@pytest.mark.parametrize("driven", [[[1, 0], [2, 0]], [[1, 0], [2, 1], [3, 2]]])
def test_channels_that_few_readings_check_are_sound(driven: list[list[int]]) -> None:
    scan = Protocol.against_sink(np.array(driven), 6, 1e-4)
    assert not any(noisy_channels(leftover(seed, 25, scan), scan) for seed in range(20))


def test_burst_noise_of_one_channel_is_seen_and_how_strong_it_is() -> None:
    bursts = leftover()
    high = np.cumsum(np.random.default_rng(1).random((12, 28)) < 0.05, axis=None).reshape(12, 28) % 2
    bursts[..., NOISY] += 6e-3 * high
    found = noisy_channels(bursts, SCAN)
    assert list(found) == [NOISY]
    assert 1.5 < found[NOISY] < 3.0


def test_a_standing_error_is_no_noise_and_what_was_not_read_says_nothing() -> None:
    standing = leftover()
    standing[..., NOISY] += 0.05
    standing[..., 7] = 0.0
    assert noisy_channels(standing, SCAN) == {}
    assert noisy_channels(standing[:1], SCAN) == {}
