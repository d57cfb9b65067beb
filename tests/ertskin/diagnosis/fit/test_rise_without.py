"""What is lost without a term, where another number leans on its bound."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.diagnosis.fit.bounded_step import Region
from ertskin.diagnosis.fit.levenberg_marquardt import Fit
from ertskin.diagnosis.fit.quadratic import Quadratic
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.physics.effects.crosstalk import Crosstalk


def test_a_number_on_its_bound_stays_in_the_region_without_a_term() -> None:
    matrix, target, value = np.array([[1.0, 0.9], [0.0, 0.3]]), np.array([-1.0, 0.3]), np.array([0.0, -0.9])

    def cost(x: np.ndarray) -> float:
        return 0.5 * float(((target - matrix @ x) ** 2).sum())

    wrong = target - matrix @ value
    quadratic = Quadratic(np.array([cost(value)]), (matrix.T @ wrong)[None], (matrix.T @ matrix)[None])
    region = Region(np.array([0.0, -10.0]), np.array([10.0, 10.0]))
    term = Term(Crosstalk(), ("fraction",))
    assert term.effect.known("fraction").neutral == 0.0
    solved = Solved(None, (term,), Fit(value, quadratic, np.zeros((2, 2)), 1, region=region), np.zeros((1, 1)))  # type: ignore[arg-type]
    assert solved.rise_without(0) == pytest.approx(cost(np.zeros(2)) - cost(value), rel=1e-6)
