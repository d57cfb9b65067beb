"""Which trial is judged where it settles: the first of few numbers that gains far less than first order promised."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from ertskin.diagnosis.fit.terms import Modes, Term
from ertskin.diagnosis.search.candidates import Candidate
from ertskin.diagnosis.search.trials import Trial, _unfulfilled
from ertskin.physics.effects.self_heating import SelfHeating
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity

LEAST = 1000.0
FIELD = Term(SheetInhomogeneity(), (), Modes(np.zeros((1, 3, 3))))
HEAT = Term(SelfHeating(crowded_rise=-0.01), ("crowded_rise",))
SPOT = Term(SheetInhomogeneity(amplitude=0.1), ("amplitude", "x_m", "y_m", "radius_m"))


def found(*gained: tuple[Term, float, float]) -> int | None:
    """The trial's number, by each term's gain as expected and as fitted."""
    candidates = [Candidate(term, expected) for term, expected, _ in gained]
    trials = [Trial(term, fitted, cast(Any, None)) for term, _, fitted in gained]
    return _unfulfilled(candidates, trials, LEAST)


@pytest.mark.parametrize(("fitted", "number"), [(-1442.0, 1), (2000.0, 1), (5000.0, None)])
def test_a_sheet_that_warms_is_judged_though_a_field_is_first(fitted: float, number: int | None) -> None:
    # The numbers of c033 of `nineteenth96`: heat promised 6529 and gained less than nothing as linearised when cold.
    assert found((FIELD, 7603.0, 7867.0), (HEAT, 6529.0, fitted)) == number


def test_of_few_numbers_the_first_alone_is_judged() -> None:
    assert found((SPOT, 7000.0, 6900.0), (HEAT, 6529.0, -1442.0)) is None
    assert found((HEAT, 6529.0, -1442.0), (SPOT, 6000.0, 100.0)) == 0


def test_what_promises_little_and_a_field_alone_are_not() -> None:
    assert found((FIELD, 7603.0, -100.0)) is None
    assert found((FIELD, 7603.0, 7867.0), (HEAT, 0.9 * LEAST, -1442.0)) is None
