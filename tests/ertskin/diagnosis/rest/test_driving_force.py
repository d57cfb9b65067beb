"""Which forces drive the skin: those that depths tell, unless the load cell surely disagrees with them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.force.noise import ForceNoise
from ertskin.diagnosis.recording.evidence import CannotTell
from ertskin.diagnosis.rest.baseline import _driving_force
from ertskin.physics.history import History

FRAMES = 108
TRUE_N = np.linspace(0.1, 0.8, FRAMES)[:, None]


def evidence(force_n: np.ndarray) -> Any:
    """A contact held under every frame, and what the load cell reads."""
    count = len(force_n)
    history = History(
        np.arange(count, dtype=float),
        np.zeros(count, dtype=np.int64),
        np.ones(count, dtype=np.uint8),
        np.full((count, 1, 2), 0.05),
        np.full((count, 1), 1e-3),
        force_n,
    )
    return SimpleNamespace(history=history, criteria=DEFAULT)


def fitted(force_n: np.ndarray, noise_n: float) -> Any:
    """A force stage that predicts the true forces."""
    residual = (force_n - TRUE_N) / noise_n
    return SimpleNamespace(residual=residual, chi_square=float(np.nansum(residual**2)), force_n=TRUE_N)


def read(rms_n: float) -> np.ndarray:
    return TRUE_N + rms_n * np.random.default_rng(0).normal(size=TRUE_N.shape)


def test_a_load_cell_known_from_a_few_frames_in_air_does_not_drive_light_presses() -> None:
    """Frames in air said 8 mN, known to a seventh; the cell has 11."""
    force_n, noise = read(0.011), ForceNoise(0.008, 25)
    assert np.array_equal(_driving_force(evidence(force_n), fitted(force_n, noise.rms_n), noise), TRUE_N)


def test_a_load_cell_that_surely_disagrees_drives() -> None:
    force_n, noise = read(0.03), ForceNoise(0.008, 25)
    assert np.array_equal(_driving_force(evidence(force_n), fitted(force_n, noise.rms_n), noise), force_n)


def test_a_cell_whose_noise_is_hardly_known_drives_where_depths_are_off_by_more() -> None:
    force_n, noise = read(0.1), ForceNoise(0.01, 1)
    assert np.array_equal(_driving_force(evidence(force_n), fitted(force_n, noise.rms_n), noise), force_n)


def test_without_either_nothing_drives() -> None:
    nowhere = np.full_like(TRUE_N, np.nan)
    with pytest.raises(CannotTell):
        _driving_force(evidence(nowhere), None, ForceNoise(0.01, 1))
    assert np.array_equal(_driving_force(evidence(TRUE_N), None, ForceNoise(0.01, 1)), TRUE_N)
