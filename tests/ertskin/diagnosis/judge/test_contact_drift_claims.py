"""Contacts that wander are claimed for what they do together, the largest first."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.judge.contact_drift_claims import drift_claims
from ertskin.physics.effects.contact_drift import ContactDrift

FRAMES, PAIRS, ELECTRODES = 6, 40, 4


def selection(sizes: list[float]) -> Any:
    """Electrode k off by ``sizes[k]`` of the noise in pairs of its own, half of the time up, half of it down."""
    path = np.resize([1.0, -1.0], FRAMES)
    time_s = tuple(np.arange(FRAMES, dtype=float).tolist())
    drifts = [ContactDrift(k, time_s, tuple((size * path).tolist())) for k, size in enumerate(sizes)]

    def residual(effects: list[ContactDrift]) -> NDArray[np.float64]:
        wrong = np.zeros((FRAMES, PAIRS))
        for drift in effects:
            wrong[:, drift.electrode :: ELECTRODES] -= np.sqrt(ELECTRODES) * np.array(drift.ohm)[:, None]
        return wrong

    problem = SimpleNamespace(
        scan_residual=residual,
        family=SimpleNamespace(skin=lambda calibration, effects: effects),
        evidence=SimpleNamespace(criteria=DEFAULT),
        weight=np.ones(FRAMES),
    )
    return SimpleNamespace(after=SimpleNamespace(effects=tuple(drifts), calibration=None), problem=problem)


def claimed(sizes: list[float], *settling: int) -> list[int]:
    return [claim.effect.electrode for claim in drift_claims(selection(sizes), settling)]  # type: ignore[attr-defined]


def test_small_ones_are_claimed_where_together_they_matter() -> None:
    alone = 0.9 * np.sqrt(DEFAULT.material_ratio**2 - 1)
    assert claimed([alone]) == []
    assert claimed([alone] * 4) == [0, 1, 2]


def test_those_that_settle_are_claimed_however_little_they_do() -> None:
    assert claimed([0.1, 0.1, 0.1], 1) == [1]
    assert claimed([0.01, 1.0, 0.5, 0.02], 3) == [1, 2, 3]


def test_the_largest_comes_first_and_what_is_left_is_not_claimed() -> None:
    assert claimed([0.01, 1.0, 0.5, 0.02]) == [1, 2]
    first = drift_claims(selection([0.01, 1.0]))[0]
    assert first.confidence == DEFAULT.measured_confidence
    assert first.ratio_alone == pytest.approx(np.sqrt(2.0), rel=1e-3)
