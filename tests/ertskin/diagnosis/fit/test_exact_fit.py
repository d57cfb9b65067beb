"""The fit where every frame is solved in full ends with the turn that moves no number by a standard error."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ertskin.diagnosis.fit.full_solution_check import EXACT_TURNS, exact

ERRORS = np.array([1e-3, 2.0])


class Turns:
    """A problem whose fits move the second of two numbers by so many standard errors, turn after turn."""

    def __init__(self, moves: list[float]) -> None:
        self.moves, self.turns = moves, 0

    def corrected(self, solved: SimpleNamespace) -> Turns:
        return self

    def solve(self, terms: object, start: np.ndarray) -> SimpleNamespace:
        moved = np.array([0.0, self.moves[self.turns]]) * ERRORS
        self.turns += 1
        return fitted(start + moved)


def fitted(value: np.ndarray) -> SimpleNamespace:
    fit = SimpleNamespace(value=value, covariance=np.diag(ERRORS**2))
    return SimpleNamespace(terms=(), calibration=value, fit=fit)


@pytest.mark.parametrize(("moves", "turns"), [([0.6], 1), ([-4.0, 0.6], 2), ([4.0, -4.0, 4.0, 4.0], EXACT_TURNS)])
def test_the_last_turn_is_the_one_that_moves_nothing_by_a_standard_error(moves: list[float], turns: int) -> None:
    problem = Turns(moves)
    _, solved = exact(problem, fitted(np.zeros(2)))  # type: ignore[arg-type]
    assert problem.turns == turns
    np.testing.assert_allclose(solved.fit.value, np.array([0.0, sum(moves[:turns])]) * ERRORS)
