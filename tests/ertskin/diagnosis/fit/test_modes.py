"""Smooth fields by their modes, which are remembered at the latest few sets of positions."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.diagnosis.fit import terms
from ertskin.diagnosis.fit.terms import Modes
from ertskin.physics.effects.smooth_field import field_at

EXTENT_M = np.array([[0.0, 0.0], [0.02, 0.03]])


@pytest.fixture
def modes() -> Modes:
    return Modes(np.random.default_rng(0).normal(size=(3, 4, 5)))


def places(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(EXTENT_M[0], EXTENT_M[1], (7, 2))


def test_each_is_the_spline_through_its_nodes(modes: Modes) -> None:
    for extent_m in (EXTENT_M, 2 * EXTENT_M):
        for _ in range(2):
            found = modes(places(1), extent_m)
            for k in range(3):
                wanted = field_at(modes.of(np.eye(3)[k]), places(1), extent_m)
                np.testing.assert_allclose(found[:, k], wanted, atol=1e-12)


def test_the_latest_few_are_remembered_and_nobody_writes_to_them(modes: Modes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(terms, "MOST_KNOWN", 2)
    first = modes(places(1), EXTENT_M)
    assert modes(places(1), EXTENT_M) is first
    assert not first.flags.writeable
    modes(places(2), EXTENT_M)
    assert modes(places(1), EXTENT_M) is first
    modes(places(3), EXTENT_M)
    assert modes(places(1), EXTENT_M) is not first
