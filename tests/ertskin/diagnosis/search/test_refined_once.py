"""Forms of which none predicted better aren't freed again about the same fit."""

from __future__ import annotations

from dataclasses import replace

import pytest
from small_problem import PARTITIONS, START, recorded

from ertskin.diagnosis.fit.full_solution_check import checked_fit
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.recording import work
from ertskin.diagnosis.search.settling import refined, spread
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis

LOOP = PiezoHysteresis(width=0.1)


def test_a_fit_is_freed_once_and_another_one_again() -> None:
    problem = recorded(LOOP)
    fit = checked_fit(problem, problem.solve([Term(LOOP, ("width",))], START))
    asked = []

    def freed(fit, partitions):
        asked.append(fit)
        return fit.solved

    once = refined(lambda solved: problem, fit, PARTITIONS, freed)
    assert once.solved is fit.solved
    assert refined(lambda solved: problem, once, PARTITIONS, freed) is once
    assert len(asked) == 1
    again = replace(once, solved=problem.solve(once.solved.terms, START))
    refined(lambda solved: problem, again, PARTITIONS, freed)
    assert len(asked) == 2


def test_nothing_is_freed_once_the_work_is_spent(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = recorded(LOOP)
    fit = checked_fit(problem, problem.solve([Term(LOOP, ("width",))], START))
    assert problem.evidence.work.done > 0
    monkeypatch.setattr(work, "MOST", problem.evidence.work.done)
    assert refined(lambda solved: problem, fit, PARTITIONS, lambda *given: pytest.fail("freed")) is fit
    assert problem.evidence.work.has_ended


def test_all_presses_spread_fields_and_free_no_forms() -> None:
    problem = recorded(LOOP)
    fit = checked_fit(problem, problem.solve([Term(LOOP, ("width",))], START))
    assert spread(fit, PARTITIONS) is fit.solved
