"""A field of sensitivity is fitted as what it is: in what presses the fabric, or in its response."""

from __future__ import annotations

from dataclasses import replace

import pytest
from small_problem import PARTITIONS, START, recorded

from ertskin.diagnosis.fit.quadratic import Quadratic
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search import trials
from ertskin.diagnosis.search.candidates import Candidate, screen
from ertskin.diagnosis.search.smooth_fields import NodeQuadratic, predictive, with_smooth_field
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity

FABRIC = PiezoInhomogeneity(amplitude=0.3, x_m=0.03, y_m=0.03, radius_m=0.02)


@pytest.mark.parametrize("part", [0.0, 1.0])
def test_a_smooth_field_acts_where_the_fabric_does(part: float) -> None:
    problem = recorded(replace(FABRIC, in_response=part))
    begun = problem.solve([Term(PiezoInhomogeneity(), ())], START, steps=0)
    freed = with_smooth_field(problem, begun, 0, PARTITIONS)
    assert freed is not None
    (term,) = problem.solve(freed.terms, freed.calibration).terms
    assert term.free == ("in_response",)
    assert term.effect.value("in_response") == pytest.approx(part, abs=0.3)


@pytest.mark.parametrize("better", [0.0, 1.0])
def test_a_candidate_is_tried_from_either_end(better: float, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = recorded(replace(FABRIC, in_response=1.0))
    current = problem.at_hand(problem.solve([], START))
    quadratic = NodeQuadratic.of(problem, current, (PiezoInhomogeneity(),), 0)
    extent_m = problem.evidence.sensor.extent_m
    ends = predictive(quadratic, extent_m, PARTITIONS).of(Term(PiezoInhomogeneity(), ()), extent_m)
    assert [term.effect.value("in_response") for term in ends] == [0.0, 1.0]
    fits = {term.effect.value("in_response"): problem.solve([term], current.calibration, steps=0) for term in ends}
    worse = replace(fits[1.0 - better], fit=replace(fits[better].fit, quadratic=_dearer(fits[better])))
    fits[1.0 - better] = worse
    monkeypatch.setattr(
        trials, "_with_term", lambda problem, current, term, left: fits[term.effect.value("in_response")]
    )
    monkeypatch.setattr(trials, "gained", lambda *given: 1.0)
    monkeypatch.setattr(trials, "_with_remainders", lambda *given: ())
    (tried,) = trials._try(problem, current, [Candidate(ends[0], 1.0, others=(ends[1],))], PARTITIONS)
    assert tried.solved is fits[better]


def test_a_smooth_field_spread_otherwise_acts_as_before() -> None:
    problem = recorded(replace(FABRIC, in_response=1.0))
    current = problem.at_hand(problem.solve([], START))
    extent_m = problem.evidence.sensor.extent_m
    process = predictive(NodeQuadratic.of(problem, current, (PiezoInhomogeneity(),), 0), extent_m, PARTITIONS)
    spot = Term(replace(FABRIC, in_response=0.4), ("amplitude", "in_response"))
    beside = process.of(spot, extent_m)
    assert [term.effect.value("in_response") for term in beside] == [0.0, 1.0]
    (again,) = process.of(replace(beside[0], effect=replace(FABRIC, in_response=0.4)), extent_m)
    assert again.effect.value("in_response") == 0.4


def test_forms_of_few_numbers_begin_from_either_end() -> None:
    problem = recorded(replace(FABRIC, in_response=1.0))
    current = problem.at_hand(problem.solve([], START))
    found = [c for c in screen(problem, current, PARTITIONS) if c.name == FABRIC.name and c.term.modes is None]
    assert {"amplitude", "ridge", "step", "gradient_x"} <= {c.term.free[0] for c in found}
    for candidate in found:
        ends = [candidate.term, *candidate.others]
        assert [term.effect.value("in_response") for term in ends] == [0.0, 1.0]
        assert all(term.free[-1] == "in_response" for term in ends)


def _dearer(solved: Solved) -> Quadratic:
    return replace(solved.fit.quadratic, cost=solved.fit.quadratic.cost + 1.0)
