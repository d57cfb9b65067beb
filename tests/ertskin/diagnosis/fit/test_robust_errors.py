"""Errors that are alike within a fold make an estimate less sure than as many independent ones would."""

import numpy as np
import pytest

from ertskin.diagnosis.fit.levenberg_marquardt import Fit
from ertskin.diagnosis.fit.quadratic import Quadratic

FOLDS, ROWS = 60, 10


def mean_fit(values):
    """The mean of values (F,R) with unit noise, as a fit by folds."""
    wrong = values - values.mean()
    gradient = wrong.sum(axis=1)[:, None]
    hessian = np.full((len(values), 1, 1), float(values.shape[1]))
    return Fit(
        np.array([values.mean()]), Quadratic(0.5 * (wrong**2).sum(axis=1), gradient, hessian), np.zeros((1, 1)), 1
    )


@pytest.mark.parametrize("alike", [0.0, 1.0])
def test_the_stated_error_is_how_the_estimate_scatters(alike):
    rng = np.random.default_rng(0)
    draws = [alike * rng.standard_normal((FOLDS, 1)) + rng.standard_normal((FOLDS, ROWS)) for _ in range(300)]
    fits = [mean_fit(values) for values in draws]
    scatter = np.std([fit.value[0] for fit in fits])
    stated = np.sqrt(np.mean([fit.robust_covariance[0, 0] for fit in fits]))
    assert stated == pytest.approx(scatter, rel=0.12)
    white = np.sqrt(fits[0].covariance[0, 0])
    assert white == pytest.approx(scatter, rel=0.12) if alike == 0 else white < 0.4 * scatter
