"""What no effect explains of forces: its evidence against the Gaussian density written out, and what it takes."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from ertskin.diagnosis.force.remainder import Remainder, likeliest
from ertskin.physics.history import History, Phase


def history(presses: int = 12, frames: int = 15) -> History:
    count = presses * frames
    press = np.repeat(np.arange(presses), frames)
    depth = np.tile(1e-3 * np.r_[np.arange(1, 9), np.arange(7, 0, -1)] / 8, presses)[:, None]
    contact = np.stack([0.02 * (press % 4), 0.02 * (press // 4)], axis=1)[:, None]
    phase = np.full(count, Phase.LOADING, dtype=np.uint8)
    return History(np.arange(count, dtype=float), press, phase, contact, depth, 2000.0 * depth)


def test_evidence_and_whitening_are_those_of_the_gaussian_density() -> None:
    rng = np.random.default_rng(0)
    design, residual = rng.standard_normal((30, 4)), rng.standard_normal(30)
    one = Remainder("any", design)
    covariance = np.eye(30) + design @ design.T
    ratio = multivariate_normal(cov=covariance).logpdf(residual) - multivariate_normal(cov=np.eye(30)).logpdf(residual)
    assert one.log_evidence(residual) == pytest.approx(ratio)
    white = one.whitened(residual)
    assert white @ white == pytest.approx(residual @ np.linalg.solve(covariance, residual))


@pytest.mark.parametrize("name", ["zero", "gain", "place to place"])
def test_what_drifts_is_told_from_what_differs_by_place(name: str) -> None:
    past, rng = history(), np.random.default_rng(1)
    time_s, force_n = past.time_s, past.force_n[:, 0]
    drift = 3 * np.sin(2 * np.pi * time_s / time_s[-1])
    by_place = rng.standard_normal(12)[past.press]
    made = {"zero": drift, "gain": 2 * drift * force_n, "place to place": 3 * by_place * force_n}[name]
    found, evidence = likeliest(past, past.touched, force_n, made + rng.standard_normal(len(made)))
    assert name in found.name
    assert evidence > 20
    assert likeliest(past, past.touched, force_n, rng.standard_normal(len(made)))[1] < 3
