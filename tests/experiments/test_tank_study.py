"""The tank study's parts: the truth is read the right way round, a perfect map correlates perfectly."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from ertskin.diagnosis.linear.sensitivity import Hats
from ertskin.diagnosis.tank.inclusions import InclusionMap

STUDY = Path(__file__).resolve().parents[2] / "experiments" / "real" / "tank"
MODULES = ("run", "figures", "baseline")


@pytest.fixture(scope="module")
def run():
    """The study's module, which lives outside any package; other studies have files of the same names."""
    sys.path.insert(0, str(STUDY))
    import run

    yield run
    sys.path.remove(str(STUDY))
    for name in MODULES:
        sys.modules.pop(name, None)


def test_the_truths_first_row_is_the_top(run, tmp_path: Path):
    image = np.zeros((1, 64, 64), dtype=np.uint8)
    image[0, 10:20, 28:36] = 2
    image[0, 40:50, 10:20] = 1
    with h5py.File(tmp_path / "tank.h5", "w") as file:
        file["truth/segmentation"] = image
        file["sensor/outline_m"] = 0.1 * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    place_m, sign = run.truth(tmp_path / "tank.h5", 0)
    assert place_m[sign == 1].mean(axis=0) == pytest.approx([0.0, 0.053], abs=2e-3)
    assert place_m[sign == -1].mean(axis=0) == pytest.approx([-0.053, -0.04], abs=2e-3)
    assert np.linalg.norm(place_m, axis=1).max() < 0.1


def test_a_map_like_the_truth_correlates_fully(run):
    hats = Hats(np.array([-0.1, -0.1]), np.array([0.1, 0.1]), 0.005)
    inside = np.ones(len(hats.node_m), dtype=bool)
    height = hats.node_m[:, 1]
    one = InclusionMap(hats, inside, height, 1.0, 0.0, 0.0)
    place_m = np.random.default_rng(0).uniform(-0.09, 0.09, (200, 2))
    assert run.correlation(one, place_m, 3 * place_m[:, 1] + 1) == pytest.approx(1.0)
    assert run.correlation(one, place_m, -place_m[:, 1]) == pytest.approx(-1.0)
