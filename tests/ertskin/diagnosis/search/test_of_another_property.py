"""Of smooth fields that explain presses alike the property is told by what they foretell, not by which entered."""

from __future__ import annotations

import pytest
from small_problem import PARTITIONS, START, recorded

from ertskin.diagnosis.fit.full_solution_check import CheckedFit, checked_fit
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search import entering
from ertskin.diagnosis.search.entering import of_another_property
from ertskin.diagnosis.search.smooth_fields import with_smooth_field
from ertskin.diagnosis.search.trials import Trial
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity

SHEET = SheetInhomogeneity()
FABRIC = PiezoInhomogeneity(amplitude=0.3, x_m=0.03, y_m=0.03, radius_m=0.02)


def fields() -> tuple[VoltageProblem, CheckedFit, dict[str, Trial]]:
    """Readings with fabric that is more sensitive in one place: the problem, the fit without, and a trial of a smooth
    field of either property, said to gain alike."""
    problem = recorded(FABRIC)
    without = problem.solve([], START)
    trials = {}
    for kind in (SheetInhomogeneity, PiezoInhomogeneity):
        begun = problem.solve([Term(kind(), ())], without.calibration, steps=0)
        solved = with_smooth_field(problem, begun, 0, PARTITIONS)
        assert solved is not None
        trials[kind.name] = Trial(solved.terms[0], 1e4, solved)
    return problem, checked_fit(problem, without), trials


@pytest.mark.parametrize("first", [SHEET.name, FABRIC.name])
def test_the_property_that_foretells_cells_takes_the_other_s_place(first: str) -> None:
    problem, incumbent, trials = fields()
    entered = trials[first], checked_fit(problem, trials[first].solved)
    found, fit = of_another_property(lambda solved: problem, incumbent, entered, list(trials.values()), PARTITIONS)
    assert found.term.name == FABRIC.name
    assert [term.name for term in fit.solved.terms] == [FABRIC.name]
    assert (found.gain > entered[0].gain) is (FABRIC.name != first)


def test_none_takes_it_where_it_spoils_or_is_not_worth_a_name(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, incumbent, trials = fields()
    entered = trials[SHEET.name], checked_fit(problem, trials[SHEET.name].solved)
    given = (lambda solved: problem, incumbent, entered, list(trials.values()), PARTITIONS)
    assert of_another_property(*given) is not entered
    with monkeypatch.context() as without:
        without.setattr(entering, "is_worth_a_name", lambda problem, current, term, gain: False)
        assert of_another_property(*given) is entered
    monkeypatch.setattr(entering, "_where_it_holds", lambda *given: None)
    assert of_another_property(*given) is entered


def test_a_field_that_gains_less_or_more_or_has_few_numbers_is_not_asked() -> None:
    problem, incumbent, trials = fields()
    entered = trials[SHEET.name], checked_fit(problem, trials[SHEET.name].solved)
    little = Trial(trials[FABRIC.name].term, 5e3, trials[FABRIC.name].solved)
    more = Trial(trials[FABRIC.name].term, 1.1e4, trials[FABRIC.name].solved)
    few = Trial(Term(FABRIC, ("amplitude",)), 1e4, trials[FABRIC.name].solved)
    for other in (little, more, few):
        found = of_another_property(lambda solved: problem, incumbent, entered, [entered[0], other], PARTITIONS)
        assert found is entered
