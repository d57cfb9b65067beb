"""Turns of linearising about a fit end where the fit hasn't moved, however far linearised frames are off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_problem import START, recorded

from ertskin.diagnosis.fit import full_solution_check
from ertskin.diagnosis.fit.full_solution_check import CheckedFit, settled
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis

LOOP = PiezoHysteresis(width=0.1)
TERM = Term(LOOP, ("width",))


@pytest.fixture(scope="module")
def made() -> tuple[VoltageProblem, Solved]:
    problem = recorded(LOOP)
    return problem, problem.solve([TERM], START)


def moved(solved: Solved, number: int, errors: float) -> Solved:
    """The fit with one of its numbers so many standard errors away."""
    value = solved.fit.value.copy()
    value[number] += errors * float(np.sqrt(solved.fit.covariance[number, number]))
    term = solved.terms[0].at(value[-1:].tolist())
    return replace(solved, fit=replace(solved.fit, value=value), terms=(term,))


def about(made: tuple[VoltageProblem, Solved], fit: Solved | None) -> bool:
    """Whether the fit made is linearised about itself where the skin was linearised about another."""
    problem, solved = made
    return CheckedFit(replace(problem, about=fit), solved, 1.0, 99.0).linearised_about_itself


@pytest.mark.parametrize("where", ["effect", "calibration"])
def test_what_moves_is_told_by_standard_errors(made: tuple[VoltageProblem, Solved], where: str) -> None:
    number = -1 if where == "effect" else 3
    # One number of the calibration counts as one of all of them.
    all_but_one = np.sqrt(made[1].first(0)) if where == "calibration" else 1.0
    assert about(made, moved(made[1], number, 0.9 * all_but_one))
    assert not about(made, moved(made[1], number, 1.1 * all_but_one))


def test_another_form_or_none_is_not_the_fit(made: tuple[VoltageProblem, Solved]) -> None:
    other = replace(made[1], terms=(Term(LOOP.changed({"spread": 0.5}), ("width",)),))
    freer = replace(made[1], terms=(Term(LOOP, ("width", "spread")),))
    assert not any(about(made, fit) for fit in (None, other, freer))


@pytest.mark.parametrize(("off", "turns"), [(0.0, 1), (9.0, 2)])
def test_where_the_fit_stays_no_further_turn_is_made(
    made: tuple[VoltageProblem, Solved], off: float, turns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, solved = made
    monkeypatch.setattr(full_solution_check, "checked_fit", lambda problem, fit: CheckedFit(problem, fit, 1.0, off))
    asked: list[Solved] = []

    def build(fit: Solved | None) -> VoltageProblem:
        assert fit is not None
        asked.append(fit)
        return replace(problem, about=fit)

    settled(build, moved(solved, -1, 5.0))
    assert len(asked) == turns


def turns_of(
    made: tuple[VoltageProblem, Solved], checks: list[tuple[float, float]], monkeypatch: pytest.MonkeyPatch
) -> tuple[CheckedFit, list[float]]:
    """What settling comes to where turns have these misfits and are off by so much, and where each was linearised: the
    last number, in standard errors from the fit."""
    problem, solved = made
    told = iter(checks)
    monkeypatch.setattr(full_solution_check, "checked_fit", lambda problem, fit: CheckedFit(problem, fit, *next(told)))
    error, asked = float(np.sqrt(solved.fit.covariance[-1, -1])), []

    def build(fit: Solved | None) -> VoltageProblem:
        assert fit is not None
        asked.append(float(fit.fit.value[-1] - solved.fit.value[-1]) / error)
        assert fit.terms[0].effect.width == pytest.approx(fit.fit.value[-1])
        # Far from itself: that the fit hasn't moved must not end the turns.
        return replace(problem, about=None)

    return settled(build, moved(solved, -1, 40.0)), asked


def test_a_turn_that_leads_no_nearer_is_made_halfway(
    made: tuple[VoltageProblem, Solved], monkeypatch: pytest.MonkeyPatch
) -> None:
    found, asked = turns_of(made, [(3.0, 9.0), (3.0, 8.0), (1.0, 0.0)], monkeypatch)
    assert found.misfit == 1.0
    first, second, third = asked
    assert first == pytest.approx(40.0)
    assert third == pytest.approx(0.5 * second, abs=0.1)


def test_turns_end_where_halfway_helps_no_more_with_the_best_of_them(
    made: tuple[VoltageProblem, Solved], monkeypatch: pytest.MonkeyPatch
) -> None:
    found, asked = turns_of(made, [(3.0, 9.0), (2.0, 8.0), (1.5, 7.5), (1.6, 7.6), (1.0, 0.0)], monkeypatch)
    assert len(asked) == 4
    assert found.misfit == 1.5
