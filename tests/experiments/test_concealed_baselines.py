"""The baselines that name nothing: what is learned of the residual, they predict in presses held out."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "experiments" / "concealed"))

from baselines import BASELINES, Residual

PRESSES, FRAMES, NUMBERS = 24, 8, 40


def left(size: float) -> Residual:
    """A residual of this size that follows place and force along a few directions, in noise of unit size."""
    rng = np.random.default_rng(0)
    press = np.repeat(np.arange(PRESSES), FRAMES)
    place = rng.uniform(-1.5, 1.5, (PRESSES, 2))[press]
    force = np.tile(np.linspace(-1.5, 1.5, FRAMES), PRESSES)
    features = np.column_stack([place, force, np.zeros((len(press), 3))])
    shape = np.stack([place[:, 0] * force, place[:, 1], np.cos(place[:, 0])], axis=1)
    wrong = size * shape @ rng.standard_normal((3, NUMBERS)) + rng.standard_normal((len(press), NUMBERS))
    return Residual(wrong, features, press % 2 == 0, 2e-3)


def test_recalibration_leaves_it() -> None:
    residual = left(3.0)
    assert residual.ratio(BASELINES["recalibration"](residual)) == residual.ratio()


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@pytest.mark.parametrize("name", ["residual_network", "gaussian_process"])
def test_learners_predict_what_follows_place_and_force(name: str) -> None:
    residual = left(3.0)
    assert residual.ratio(BASELINES[name](residual)) < 0.6 * residual.ratio()


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@pytest.mark.parametrize("name", ["residual_network", "gaussian_process"])
def test_learners_make_little_of_noise(name: str) -> None:
    residual = left(0.0)
    assert residual.ratio(BASELINES[name](residual)) < 1.15 * residual.ratio()
