"""What a claim states of the specimen's shape: where the skin's fit has it, and no other form's."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ertskin.diagnosis.contract.claims import Claim, Estimate, Rival
from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.judge.answer import _taken
from ertskin.diagnosis.skin import _likeliest, _with_size_free
from ertskin.diagnosis.specimen.fit import SpecimenFinding
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis

SHOWN = PiezoCreep(0.1, 3.0, decades=2.0, half_pa=2e4, multiplies=True)
FINDING = SpecimenFinding(SHOWN, ("fraction", "time_s", "decades", "half_pa"), (), (0.01, 0.1, np.inf, 500.0))


def test_only_how_much_there_is_of_it_is_the_skins_own() -> None:
    assert _with_size_free(FINDING, DEFAULT) == [(Term(SHOWN, ("fraction",)), ())]


def test_what_the_specimen_cannot_tell_apart_is_left_to_the_readings() -> None:
    loop, lag = PiezoHysteresis(width=0.1, spread=0.5), PiezoHysteresis(lag=0.2, way_pa=2e3)
    rivals = Rival(loop, 3.0), Rival(lag, 40.0), Rival(PiezoHysteresis(), 5.0)
    (own, _), (other, against) = _with_size_free(replace(FINDING, rivals=rivals), DEFAULT)
    assert own == Term(SHOWN, ("fraction",))
    assert other == Term(loop, ("width",))
    assert against == (Rival(SHOWN, -3.0),)


def test_the_readings_choose_and_say_how_far_behind_the_other_is() -> None:
    loop = PiezoHysteresis(width=0.1)
    sets = [[(Term(SHOWN, ("fraction",)), (Rival(loop, 3.0),))], [(Term(loop, ("width",)), (Rival(SHOWN, -3.0),))]]
    cost = {"piezo_creep": 120.0, "piezo_hysteresis": 100.0}
    problem = SimpleNamespace(solve=lambda terms, start: SimpleNamespace(cost=cost[terms[-1].name]))
    chosen = _likeliest(sets, lambda solved: problem, (), None)  # type: ignore[arg-type, return-value]
    assert chosen == [(Term(loop, ("width",)), (Rival(SHOWN, 17.0),))]


def test_what_the_skin_has_taken_is_stated_with_the_specimens_errors() -> None:
    taken = _taken(Term(SHOWN.changed({"fraction": 0.2}), ("fraction",)), FINDING)
    assert list(taken) == ["time_s", "decades", "half_pa"]
    assert taken["time_s"].high - taken["time_s"].low == pytest.approx(2 * 1.645 * 0.1, rel=1e-3)
    assert (taken["decades"].low, taken["decades"].high) == (0.0, 6.0)


@pytest.mark.parametrize(
    "term",
    [
        Term(SHOWN.changed({"time_s": 2.0}), ("fraction",)),
        Term(SHOWN.changed({"multiplies": False}), ("fraction", "time_s", "decades")),
    ],
    ids=["another time constant", "another law"],
)
def test_nothing_is_stated_of_a_form_that_the_skin_does_not_have(term: Term) -> None:
    assert _taken(term, FINDING) == {}


def test_parameters_say_who_told_them() -> None:
    own, taken = Estimate(0.1, 0.09, 0.11, "1"), Estimate(3.0, 2.9, 3.1, "s")
    claim = Claim(SHOWN, 0.9, 2.0, {"fraction": own}, of_specimen={"time_s": taken})
    parameters = claim.as_builtins()["parameters"]
    assert parameters["time_s"] == {**taken.as_builtins(), "source": "specimen"}
    assert parameters["fraction"] == own.as_builtins()
    assert claim.shown == {"fraction": own, "time_s": taken}
