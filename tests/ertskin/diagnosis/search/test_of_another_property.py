"""Of smooth fields that explain presses alike the property is told by what they predict, not by which entered."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from small_problem import PARTITIONS, START, recorded

from ertskin.diagnosis.fit.full_solution_check import CheckedFit, checked_fit
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search import entering
from ertskin.diagnosis.search.entering import first_to_hold
from ertskin.diagnosis.search.smooth_fields import NodeQuadratic, predictive, with_smooth_field
from ertskin.diagnosis.search.trials import Trial
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity

SHEET = SheetInhomogeneity()
GAIN = 1e4
FABRIC = PiezoInhomogeneity(amplitude=0.05, x_m=0.03, y_m=0.03, radius_m=0.02)


def fields() -> tuple[VoltageProblem, CheckedFit, dict[str, Trial]]:
    """Readings with fabric that is more sensitive in one place: the problem, the fit without, and a trial of a smooth
    field of either property, said to gain alike."""
    problem = recorded(FABRIC)
    without = problem.solve([], START)
    trials = {}
    for kind in (SheetInhomogeneity, PiezoInhomogeneity):
        begun = problem.at_hand(problem.solve([Term(kind(), ())], without.calibration, steps=0))
        # Nothing is fitted of a field of which more is asked than it is expected to gain.
        assert with_smooth_field(problem, begun, 0, PARTITIONS, least=1e9) is None
        quadratic, extent_m = NodeQuadratic.of(problem, begun, begun.effects, 0), problem.evidence.sensor.extent_m
        starts = predictive(quadratic, extent_m, PARTITIONS).of(begun.terms[0], extent_m)
        solved = min((problem.solve([term], begun.calibration) for term in starts), key=lambda fit: fit.cost)
        trials[kind.name] = Trial(solved.terms[0], GAIN, solved)
    # Neither is to spoil the few frames that are solved in full: what decides is what they predict.
    return problem, replace(checked_fit(problem, without), misfit=1e6), trials


def entered(
    trials: list[Trial],
    problem: VoltageProblem,
    incumbent: CheckedFit,
    monkeypatch: pytest.MonkeyPatch,
    nowhere: Any = None,
) -> Trial:
    """The one of the trials that enters, each resting where it is, but for the fit that settles ``nowhere``."""

    def rests(build: Any, of: Any, solved: Any) -> CheckedFit | None:
        return None if solved is nowhere else checked_fit(problem, solved)

    monkeypatch.setattr(entering, "where_it_settles", rests)
    found = first_to_hold(lambda solved: problem, incumbent, trials, PARTITIONS)
    assert found is not None
    assert [term.name for term in found[1].solved.terms] == [found[0].term.name]
    return found[0]


@pytest.mark.parametrize("first", [SHEET.name, FABRIC.name])
def test_the_property_that_predicts_cells_enters(first: str, monkeypatch: pytest.MonkeyPatch) -> None:
    problem, incumbent, trials = fields()
    ordered = sorted(trials.values(), key=lambda trial: trial.term.name != first)
    found = entered(ordered, problem, incumbent, monkeypatch)
    assert found.term.name == FABRIC.name
    assert (found.gain > GAIN) is (FABRIC.name != first)


@pytest.mark.parametrize("why", ["gains less", "has few numbers", "settles nowhere"])
def test_the_other_does_not_enter_where_it(why: str, monkeypatch: pytest.MonkeyPatch) -> None:
    problem, incumbent, trials = fields()
    sheet, fabric = trials[SHEET.name], trials[FABRIC.name]
    nowhere = fabric.solved if why == "settles nowhere" else None
    if why == "gains less":
        fabric = replace(fabric, gain=0.5 * GAIN)
    if why == "has few numbers":
        fabric = replace(fabric, term=Term(FABRIC, ("amplitude",)))
    assert entered([sheet, fabric], problem, incumbent, monkeypatch, nowhere).term.name == SHEET.name
