"""What a term must gain: much of the misfit, unless rest frames have shown its effect."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.trials import is_worth_a_name, worth_a_name
from ertskin.physics.effects.self_heating import SelfHeating
from ertskin.physics.effects.temperature_drift import TemperatureDrift

HEAT, DRIFT = Term(SelfHeating(crowded_rise=-0.01), ("crowded_rise",)), Term(TemperatureDrift(), ("rate_per_h",))


def problem(seen_at_rest: str | None) -> Any:
    scans = SimpleNamespace(scan_v=np.zeros((400, 276)), criteria=DEFAULT, seen_at_rest=seen_at_rest)
    return SimpleNamespace(evidence=scans, weight=np.ones(400))


CURRENT = cast(Any, SimpleNamespace(scan_residual=np.ones((400, 276))))


@pytest.mark.parametrize(
    ("seen", "term", "worth"), [(None, HEAT, False), ("self_heating", HEAT, True), ("self_heating", DRIFT, False)]
)
def test_what_rest_frames_show_need_not_be_material(seen: str | None, term: Term, worth: bool) -> None:
    asked = problem(seen)
    significant, material = DEFAULT.significant_gain, worth_a_name(asked, CURRENT)
    assert material > 10 * significant
    assert is_worth_a_name(asked, CURRENT, term, material)
    assert is_worth_a_name(asked, CURRENT, term, 2 * significant) is worth
    assert not is_worth_a_name(asked, CURRENT, term, 0.5 * significant)
