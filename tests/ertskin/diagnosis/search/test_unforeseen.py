"""Effects so large that a first order predicts harm are fitted all the same."""

from __future__ import annotations

import pytest
from small_problem import PARTITIONS, START, recorded

from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.candidates import Candidate
from ertskin.diagnosis.search.trials import rms_of, unforeseen, worth_a_name
from ertskin.physics.effects.contact_pressure_dependence import ContactPressureDependence
from ertskin.physics.effects.electrode_displacement import ElectrodeDisplacement
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity

CONTACT = ContactPressureDependence(sensitivity_per_pa=3e-3)


def foreseen(gain: float) -> list[Candidate]:
    return [Candidate(Term(CONTACT, ("sensitivity_per_pa", "bend")), gain)]


def test_a_contact_that_the_tangent_predicts_harm_of_is_fitted() -> None:
    problem = recorded(CONTACT)
    current = problem.solve([], START)
    trials = unforeseen(problem, current, foreseen(-1e9), PARTITIONS)
    assert {trial.term.name for trial in trials} == {CONTACT.name}
    assert trials[0].gain > 0.9 * current.cost > worth_a_name(problem, current)
    # The skin is linearised without it, so its fit ends a fifth off; linearised about that it settles.
    assert trials[0].term.effect.value("sensitivity_per_pa") == pytest.approx(3e-3, rel=0.3)
    assert rms_of(trials[0].solved) < 0.25 * rms_of(current)


@pytest.mark.parametrize("gain", [-1.0, 1e9])
def test_what_the_tangent_can_tell_of_is_not_fitted_again(gain: float) -> None:
    problem = recorded(CONTACT)
    assert not unforeseen(problem, problem.solve([], START), foreseen(gain), PARTITIONS)


def test_a_field_is_not_fitted_from_all_its_starts() -> None:
    problem = recorded(CONTACT)
    field = [Candidate(Term(PiezoInhomogeneity(amplitude=0.1), ("amplitude",)), -1e9)]
    assert not unforeseen(problem, problem.solve([], START), field, PARTITIONS)


def test_nothing_is_fitted_where_little_is_left() -> None:
    problem = recorded()
    assert not unforeseen(problem, problem.solve([], START), foreseen(-1e9), PARTITIONS)


def test_what_is_screened_about_nothing_at_all_is_not_fitted() -> None:
    problem = recorded(CONTACT)
    moved = ElectrodeDisplacement(electrode=3, dx_m=1e-3)
    found = [Candidate(Term(moved, ("dx_m", "dy_m")), -1e9)]
    assert not unforeseen(problem, problem.solve([], START), found, PARTITIONS)
