"""Which presses the study keeps."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from ertskin.hardware.recording import Frames, Recording
from ertskin.physics.history import History
from ertskin.physics.sensor import taxel_grid_m

STUDY = Path(__file__).resolve().parents[2] / "experiments" / "anywhere" / "few_presses"


@pytest.fixture(scope="module")
def presses():
    """The study's module, which lives outside any package."""
    sys.path.insert(0, str(STUDY))
    import presses

    yield presses
    sys.path.remove(str(STUDY))


def pressed(columns: int, rows: int, size_m: tuple[float, float]) -> Recording:
    """One press on each taxel."""
    place_m = taxel_grid_m(size_m, columns, rows)
    history = History.of_presses(place_m, np.ones(len(place_m)))
    return Recording("", "", frames=Frames(np.zeros((len(history), 1, 1), dtype=np.float32), history))


@pytest.mark.parametrize("count", [1, 2, 3, 6, 12])
@pytest.mark.parametrize("skin", [(6, 6, (0.12, 0.12)), (5, 3, (0.15, 0.09)), (3, 5, (0.09, 0.15))])
def test_gridded_presses_differ_and_lie_evenly(presses, count, skin):
    recording = pressed(*skin)
    numbers, place_m = presses.places_of(recording)
    kept = presses.gridded(recording, count)
    assert len(set(kept)) == count
    middle = place_m[[numbers.index(k) for k in kept]].mean(axis=0)
    spacing = skin[2][0] / skin[0]
    assert np.abs(middle - np.array(skin[2]) / 2).max() <= 0.51 * spacing


def test_random_orders_are_drawn_by_their_seed(presses):
    recording = pressed(5, 3, (0.15, 0.09))
    first, again, other = (presses.random_order(recording, seed) for seed in (0, 0, 1))
    assert first == again != other
    assert sorted(first) == list(range(15))
