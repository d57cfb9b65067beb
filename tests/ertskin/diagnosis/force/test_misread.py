"""Foam that gives way and a load cell at its stop make the same forces: how much of them the sheet feels tells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_problem import START, recorded

from ertskin.diagnosis.contract.claims import Claim
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.force.claims import FELT_ERROR, _felt, _misread
from ertskin.diagnosis.search.chosen import Selection
from ertskin.physics.effects.foam_softening import FoamSoftening
from ertskin.physics.effects.nonlinear_foam import NonlinearFoam

GIVES_WAY = NonlinearFoam(stiffening=-0.3, exponent=1.0)


def weighed(carried: float, stiffening: float = -0.3) -> Claim:
    """A claim by force of foam, of which the sheet doesn't feel the part ``carried``, once the readings are fitted."""
    foam = replace(GIVES_WAY, stiffening=stiffening)
    problem = recorded(replace(foam, carried=carried))
    solved = problem.solve([Term(foam, ("carried",))], START)
    return _felt(Claim(foam, 0.99, 2.0, {}, by_force=True), Selection(solved, solved, (), problem, ()))


@pytest.mark.parametrize(("carried", "misreads"), [(0.0, False), (1.0, True)])
def test_readings_tell_a_load_cell_at_its_stop_from_foam_that_gives_way(carried: float, misreads: bool) -> None:
    claim = weighed(carried)
    assert claim.effect.value("carried") == pytest.approx(carried, abs=0.1)
    assert claim.misread is not None
    assert (claim.misread > 15.0) is misreads


def test_no_load_cell_shows_more_force_than_presses_on_it() -> None:
    assert weighed(1.0, stiffening=0.3).misread is None


def test_what_is_known_to_less_than_foams_form_moves_it_counts_by_that() -> None:
    assert _misread(GIVES_WAY, {"carried": (0.8, 0.0)}) == pytest.approx((0.8**2 - 0.2**2) / (2 * FELT_ERROR**2))
    assert _misread(GIVES_WAY, {"carried": (0.1, 0.1)}) == pytest.approx((0.1**2 - 0.9**2) / (2 * 2 * FELT_ERROR**2))
    assert _misread(GIVES_WAY, {"carried": (0.5, 0.1)}) == pytest.approx(0.0)


def test_other_foam_and_readings_that_were_not_asked_say_nothing() -> None:
    assert _misread(FoamSoftening(), {}) is None
    assert _misread(GIVES_WAY, {}) is None
    assert np.isfinite(GIVES_WAY.misread()["carried"])
