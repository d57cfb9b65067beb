"""What follows presses at once is told from what lags behind them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_problem import PARTITIONS, START, recorded

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.backward import with_lag
from ertskin.diagnosis.search.chosen import Chosen
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis

SLOW = PiezoCreep(fraction=0.2, time_s=5.0, multiplies=True, half_pa=2e4)
QUICK = PiezoCreep(fraction=0.2, time_s=0.05, multiplies=True, half_pa=2e4)


def lost_at_once(hidden: Effect, free: tuple[str, ...]) -> float | None:
    problem = recorded(hidden)
    solved = problem.solve([Term(hidden, free)], START)
    return with_lag(problem, solved, 0, Chosen(solved.terms[0], 0.0, 1.0, ()), PARTITIONS).by_lag


def test_a_creep_that_lags_loses_much_where_it_follows_at_once() -> None:
    lost = lost_at_once(SLOW, ("fraction", "time_s"))
    assert lost is not None
    assert lost > 100.0


def test_a_creep_without_lag_loses_nothing() -> None:
    assert lost_at_once(QUICK, ("fraction", "time_s")) == pytest.approx(0.0, abs=3.0)


def test_what_the_specimen_loses_counts_too(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = recorded(QUICK)
    solved = problem.solve([Term(QUICK, ("fraction", "time_s"))], START)

    def worse_on_the_specimen(*given: object, **others: object) -> Solved:
        quadratic = solved.fit.quadratic
        cost = quadratic.cost + 40.0 * np.eye(len(quadratic.cost))[-1]
        return replace(solved, fit=replace(solved.fit, quadratic=replace(quadratic, cost=cost)))

    monkeypatch.setattr(VoltageProblem, "solve", worse_on_the_specimen)
    found = with_lag(problem, solved, 0, Chosen(solved.terms[0], 0.0, 1.0, ()), PARTITIONS)
    assert found.by_lag == pytest.approx(40.0)


@pytest.mark.parametrize(
    ("effect", "free"),
    [(PiezoHysteresis(width=0.1), ("width",)), (PiezoCreep(fraction=0.1, time_s=10.0), ("fraction", "time_s"))],
    ids=["a loop", "creep in proportion to the pressure"],
)
def test_what_leaves_no_law_of_its_own_is_not_asked(effect: Effect, free: tuple[str, ...]) -> None:
    assert lost_at_once(effect, free) is None
