"""Forms of which none predicted better aren't freed again about the same fit."""

from __future__ import annotations

from dataclasses import replace

import pytest
from small_problem import CHANNELS, PARTITIONS, START, recorded

from ertskin.diagnosis.fit.full_solution_check import CheckedFit, checked_fit
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.recording import work
from ertskin.diagnosis.search import settling
from ertskin.diagnosis.search.forms import freer
from ertskin.diagnosis.search.settling import refined, spread
from ertskin.physics.effects.crosstalk import Crosstalk
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


KEEPS = Crosstalk(fraction=0.01, shares=(0.0,) * CHANNELS)
PASSES = replace(KEEPS, channel=2, contacts_ohm=(0.0,) * CHANNELS)


@pytest.mark.parametrize(
    ("term", "asked"),
    [(Term(PASSES, ("fraction",)), 2), (Term(KEEPS, ("fraction",)), 1), (Term(LOOP, ("width",)), 1)],
    ids=["contacts to be freed next", "nothing new to be freed", "of the fabric"],
)
def test_an_instrument_s_form_that_gains_little_is_freed_on_while_it_offers_more(
    term: Term, asked: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What each channel keeps is freed first, then what contacts pass."""
    problem = recorded(KEEPS)
    other = Term(LOOP, ("width",))
    fit = checked_fit(problem, problem.solve([Term(KEEPS, ("fraction",)), other], START))
    fit = replace(fit, solved=replace(fit.solved, terms=(term, other)))
    forms = []

    def freed(fit: CheckedFit, partitions: object) -> Solved:
        forms.append(freer(fit.solved.terms[0])[-1])
        return replace(fit.solved, terms=(forms[-1], other))

    monkeypatch.setattr(settling, "where_it_settles", lambda build, made_with, solved: replace(fit, solved=solved))
    assert refined(lambda solved: problem, fit, PARTITIONS, freed).solved.terms == (forms[-1], other)
    assert len(forms) == asked
