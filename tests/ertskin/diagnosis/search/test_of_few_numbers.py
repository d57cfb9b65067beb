"""A form of few numbers is preferred to a field that entered first where it settles better, and only there."""

from __future__ import annotations

import pytest
from small_problem import PARTITIONS, START, recorded

from ertskin.diagnosis.fit.full_solution_check import CheckedFit, checked_fit
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.entering import of_few_numbers
from ertskin.diagnosis.search.trials import Trial
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity

STRETCH = SheetAnisotropy(stretch_x=0.05)
HILL = SheetInhomogeneity(amplitude=0.1, x_m=0.03, y_m=0.03, radius_m=0.02)
TERMS = Term(HILL, ("amplitude", "x_m", "y_m", "radius_m")), Term(STRETCH, ("stretch_x",))


def entered(hidden: Effect) -> tuple[VoltageProblem, CheckedFit, list[Trial], CheckedFit]:
    """Readings with one effect: the problem, the fit without, the trials of hill and stretch, and the hill's fit."""
    problem = recorded(hidden)
    without = problem.solve([], START)
    solved = [problem.solve([term], without.calibration) for term in TERMS]
    trials = [Trial(one.terms[-1], without.cost - one.cost, one) for one in solved]
    return problem, checked_fit(problem, without), trials, checked_fit(problem, solved[0])


@pytest.mark.parametrize("hidden", [STRETCH, HILL])
def test_what_settles_better_than_a_hill_takes_its_place(hidden: Effect) -> None:
    problem, incumbent, trials, hill = entered(hidden)
    # What the linearised sheet makes of both is as good: that of the hill is first.
    alike = [Trial(trial.term, 1e9, trial.solved) for trial in trials]
    found, fit = of_few_numbers(lambda solved: problem, incumbent, (alike[0], hill), alike, PARTITIONS)
    assert found.term.name == hidden.name
    assert [term.name for term in fit.solved.terms] == [hidden.name]


def test_what_gains_little_of_it_is_not_asked() -> None:
    problem, incumbent, (hill_trial, stretch), hill = entered(STRETCH)
    little = Trial(stretch.term, 0.1 * hill_trial.gain, stretch.solved)
    found, _ = of_few_numbers(lambda solved: problem, incumbent, (hill_trial, hill), [hill_trial, little], PARTITIONS)
    assert found is hill_trial
