"""How likely a misfit on presses held out is by chance, where the noise itself is known to a part of itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest

from ertskin.diagnosis.judge.held_out import misfit_p


@pytest.mark.parametrize("told_by", [104, 3000])
def test_chances_of_noise_measured_with_an_error_are_spread_evenly(told_by: int) -> None:
    rng = np.random.default_rng(0)
    measured = np.sqrt((rng.standard_normal((400, told_by)) ** 2).mean(axis=1))
    residuals = rng.standard_normal((400, 8000)) / measured[:, None]
    chances = [misfit_p(each, np.sqrt(0.5 / told_by)) for each in residuals]
    assert kstest(chances, "uniform").pvalue > 0.01
    # Taken for known exactly, many nulls have hardly a chance.
    assert kstest([misfit_p(each, 0.0) for each in residuals], "uniform").pvalue < 0.01


def test_noise_known_exactly_is_the_limit_of_noise_known_well() -> None:
    residual = 1.02 * np.random.default_rng(1).standard_normal(3000)
    assert misfit_p(residual, 1e-6) == pytest.approx(misfit_p(residual, 0.0), rel=1e-3)
