"""The robust line: exact on lines, honest on noise, unmoved by a few wild points."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.physics.calibration.robust_line import RobustLine


def test_exact_points_give_the_exact_line():
    x = np.linspace(0, 1, 9)
    line = RobustLine.fit(x, 3 * x - 2)
    assert (line.slope, line.intercept) == (pytest.approx(3), pytest.approx(-2))


def test_standard_errors_are_calibrated():
    x = np.linspace(0, 1, 40)
    fits = [RobustLine.fit(x, 2 * x + np.random.default_rng(seed).standard_normal(40)) for seed in range(400)]
    score = np.array([(fit.slope - 2) / fit.slope_standard_error for fit in fits])
    assert score.std() == pytest.approx(1.0, abs=0.15)
    assert abs(score.mean()) < 0.2


def test_wild_points_hardly_move_it():
    rng = np.random.default_rng(1)
    x = np.linspace(0, 1, 50)
    y = 9 * x + 0.01 * rng.standard_normal(50)
    y[[3, 40]] += [5.0, -7.0]
    line = RobustLine.fit(x, y)
    assert line.slope == pytest.approx(9, abs=0.03)
    assert abs(np.polyfit(x, y, 1)[0] - 9) > 0.3


@pytest.mark.parametrize("x", [np.zeros(5), np.arange(2.0), np.array([1.0, np.nan, np.nan, 2.0])])
def test_points_that_make_no_line_are_refused(x: np.ndarray):
    with pytest.raises(ValueError, match="line needs"):
        RobustLine.fit(x, x)
