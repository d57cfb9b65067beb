"""A field of sensitivity is fitted as what it is: in what presses the fabric, or in its response."""

from __future__ import annotations

from dataclasses import replace

import pytest
from small_problem import PARTITIONS, START, recorded

from ertskin.diagnosis.fit.quadratic import Quadratic
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search import trials
from ertskin.diagnosis.search.candidates import Candidate
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


def _dearer(solved: Solved) -> Quadratic:
    return replace(solved.fit.quadratic, cost=solved.fit.quadratic.cost + 1.0)
