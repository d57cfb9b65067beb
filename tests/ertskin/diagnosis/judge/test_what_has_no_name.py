"""What is surely missing is said where nothing is worth a name: in the readings, and in the load cell's forces."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from ertskin.diagnosis.contract.claims import Tried
from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.force.claims import ForceAnswer, _where_off
from ertskin.diagnosis.judge.answer import SURELY_MISSING, Case, _reason, _stage, _verdict
from ertskin.physics.effects.channel_gain import ChannelGain
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity


def tried(*effects: str, gain: float = 2 * SURELY_MISSING) -> Tried:
    return Tried(effects, gain, kept=False)


def case_of(*sets: Tried, force: ForceAnswer | None = None) -> Any:
    """A case without a mismatch, of which nothing is chosen and these sets were fitted."""
    case: Any = MagicMock(criteria=DEFAULT, instrument_off=False, faulty=(), repeating=(), noisy={}, misread=False)
    case.selection = MagicMock(tried=sets, chosen=(), specimen=None)
    case.selection.after.terms = ()
    case.force = force or ForceAnswer((), 0.01, 0.01, off=False)
    case.found = MagicMock(ratio_before=1.0, ratio_after=1.0, before=np.ones((4, 3)))
    case.evidence.history.__getitem__.return_value = SimpleNamespace(press=np.arange(4))
    case.baseline.noise.error = 0.0
    case.unnamed, case.unclaimed = Case.unnamed.fget(case), ()  # type: ignore[attr-defined]
    return case


@pytest.mark.parametrize(
    ("sets", "said"),
    [
        ((tried("temperature_drift"),), "temperature_drift"),
        ((tried("self_heating", gain=1.1 * SURELY_MISSING), tried("temperature_drift")), "temperature_drift"),
        ((tried("temperature_drift", gain=0.9 * SURELY_MISSING),), None),
        ((tried("piezo_creep", "piezo_inhomogeneity"),), None),
        ((tried("channel_gain"), tried("crosstalk")), None),
        ((tried("form_error"), tried("temperature_drift", gain=1.0)), None),
        ((), None),
    ],
)
def test_what_gains_more_than_chance_is_missing_though_not_worth_a_name(
    sets: tuple[Tried, ...], said: str | None
) -> None:
    case = case_of(*sets)
    assert _verdict(case, [], jitters=False) == ("no_mismatch" if said is None else "unexplained")
    reason = _reason(case, [], jitters=False)
    assert reason is None if said is None else reason is not None and said in reason


@pytest.mark.parametrize(
    ("effect", "loss", "said"),
    [
        (PiezoInhomogeneity(), 2 * SURELY_MISSING, True),
        (PiezoInhomogeneity(), 0.5 * SURELY_MISSING, False),
        (ChannelGain(), 2 * SURELY_MISSING, False),
    ],
    ids=["surely", "perhaps", "of the instrument"],
)
def test_what_fitted_presses_show_is_missing_though_presses_held_out_do_not(
    effect: Effect, loss: float, said: bool
) -> None:
    case = case_of()
    case.selection.chosen = (SimpleNamespace(term=Term(effect, ()), loss=loss),)
    case.unclaimed = Case.unclaimed.fget(case)  # type: ignore[attr-defined]
    assert _verdict(case, [], jitters=False) == ("unexplained" if said else "no_mismatch")
    reason = _reason(case, [], jitters=False)
    assert (reason is not None and effect.name in reason) is said


def test_beside_what_is_in_the_fit_it_may_be_owed_to_that_ones_form() -> None:
    case = case_of(tried("temperature_drift"))
    case.selection.after.terms = (MagicMock(),)
    assert Case.unnamed.fget(case) is None  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("presses", "where"),
    [((5,), ", mostly in press 5: repeat it"), ((5, 7), ", mostly in presses 5, 7: repeat them"), ((), "")],
    ids=["one", "two", "many"],
)
def test_forces_that_are_off_are_said_and_where(presses: tuple[int, ...], where: str) -> None:
    case = case_of(force=ForceAnswer((), 0.01, 0.01, off=True, off_by=1.62, most_off=presses))
    assert _verdict(case, [], jitters=False) == "unexplained"
    assert _stage(case, [], "unexplained", jitters=False) == "mechanics"
    assert _reason(case, [], jitters=False) == f"forces over depth are off by 1.6 times the load cell's noise{where}"


def test_the_fewest_presses_that_hold_half_of_the_excess_are_found() -> None:
    press = np.repeat(np.arange(-1, 7), 5)
    residual = np.full((40, 1), 0.9)
    residual[press == -1] = np.nan
    residual[press == 2] = 4.0
    history: Any = SimpleNamespace(press=press)
    ratio, presses = _where_off(history, SimpleNamespace(residual=residual))  # type: ignore[arg-type]
    assert presses == (2,)
    assert ratio == pytest.approx(np.sqrt((6 * 0.81 + 16) / 7))
    residual[press >= 0] = 1.6
    assert _where_off(history, SimpleNamespace(residual=residual))[1] == ()  # type: ignore[arg-type]
