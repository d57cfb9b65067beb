"""What a term must gain: much of the misfit, less where little is missing and no name's form may be in error."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.trials import (
    FIRST_SHARE,
    Trial,
    compatible_with_instrument,
    instrument_worth_a_name,
    is_worth_a_name,
    material_cost,
    worth_a_name,
    worthy,
)
from ertskin.physics.effects.adc_saturation import AdcSaturation
from ertskin.physics.effects.channel_gain import ChannelGain
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.self_heating import SelfHeating
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy
from ertskin.physics.effects.temperature_drift import TemperatureDrift

LESS = 1 + FIRST_SHARE * (DEFAULT.material_ratio - 1)
FIELD = Term(PiezoInhomogeneity(), ("amplitude",))
STRETCH = Term(SheetAnisotropy(stretch_x=0.05), ("stretch_x",))
GAIN, CREEP = Term(ChannelGain(gain=0.01), ("gain",)), Term(PiezoCreep(fraction=0.1), ("fraction",))
HEAT, DRIFT = Term(SelfHeating(crowded_rise=-0.01), ("crowded_rise",)), Term(TemperatureDrift(), ("rate_per_h",))


def problem(seen_at_rest: str | None) -> Any:
    scans = SimpleNamespace(scan_v=np.zeros((400, 276)), criteria=DEFAULT, seen_at_rest=seen_at_rest)
    return SimpleNamespace(evidence=scans, weight=np.ones(400))


NUMBERS = 400 * 276


def fit(*terms: Term, rms: float = 1.0) -> Any:
    return SimpleNamespace(terms=terms, scan_residual=np.full((400, 276), rms))


@pytest.mark.parametrize(
    ("seen", "term", "worth"), [(None, HEAT, False), ("self_heating", HEAT, True), ("self_heating", DRIFT, False)]
)
def test_what_rest_frames_show_need_not_be_material(seen: str | None, term: Term, worth: bool) -> None:
    asked = problem(seen)
    significant, material = DEFAULT.significant_gain, worth_a_name(asked, fit(DRIFT))
    assert material > 10 * significant
    assert is_worth_a_name(asked, fit(), term, material)
    assert is_worth_a_name(asked, fit(), term, 2 * significant) is worth
    assert not is_worth_a_name(asked, fit(), term, 0.5 * significant)


@pytest.mark.parametrize(
    ("others", "rms", "entering", "ratio"),
    [
        ((), 1.0, STRETCH, LESS),
        ((STRETCH,), 1.0, STRETCH, LESS),
        ((replace(STRETCH),), 1.0, STRETCH, DEFAULT.material_ratio),
        ((DRIFT,), 1.0, STRETCH, DEFAULT.material_ratio),
        ((DRIFT, STRETCH), 1.0, STRETCH, DEFAULT.material_ratio),
        ((), 1.1, STRETCH, DEFAULT.material_ratio),
        ((), 1.0, FIELD, DEFAULT.material_ratio),
        ((), 1.0, HEAT, LESS),
        ((), 1.0, DRIFT, DEFAULT.material_ratio),
        ((), 1.0, GAIN, DEFAULT.material_ratio),
        ((), 1.0, CREEP, LESS),
    ],
    ids=[
        "first",
        "first, fitted",
        "second of a name",
        "second",
        "one of two",
        "much is missing",
        "a field of presses",
        "follows the scan",
        "drifts",
        "may drift",
        "follows presses",
    ],
)
def test_a_first_name_may_be_worth_less_where_little_is_missing(
    others: tuple[Term, ...], rms: float, entering: Term, ratio: float
) -> None:
    current = fit(*others, rms=rms)
    least = material_cost(NUMBERS, 0.5 * NUMBERS * rms**2, ratio)
    if entering is STRETCH and STRETCH not in others:
        assert worth_a_name(problem(None), current) == pytest.approx(least)
    assert is_worth_a_name(problem(None), current, entering, 1.01 * least)
    assert not is_worth_a_name(problem(None), current, entering, 0.99 * least)


def test_a_first_name_asks_for_more_than_coloured_noise_makes_but_for_no_more_than_is_material() -> None:
    few = SimpleNamespace(terms=(), scan_residual=np.ones((10, 276)))
    asked = SimpleNamespace(evidence=problem(None).evidence, weight=np.ones(10))
    material = material_cost(2760, 0.5 * 2760, DEFAULT.material_ratio)
    assert worth_a_name(asked, few) == pytest.approx(min(45.0, material))  # type: ignore[arg-type]
    strict = SimpleNamespace(**vars(asked.evidence) | {"criteria": replace(DEFAULT, material_ratio=1.005)})
    lenient = SimpleNamespace(evidence=strict, weight=np.ones(10))
    assert worth_a_name(lenient, few) == DEFAULT.significant_gain  # type: ignore[arg-type]


@pytest.mark.parametrize("unsaid", [FIELD, GAIN], ids=["a field of presses", "what may drift"])
@pytest.mark.parametrize(("its_gain", "named"), [(500.0, True), (800.0, False)], ids=["gains less", "gains more"])
@pytest.mark.parametrize("earlier", [True, False], ids=["asked before", "asked with it"])
def test_nothing_is_named_that_something_which_is_not_gains_more_than(
    unsaid: Term, its_gain: float, named: bool, earlier: bool
) -> None:
    asked, material = problem("temperature_drift"), material_cost(NUMBERS, 0.5 * NUMBERS, DEFAULT.material_ratio)
    assert its_gain < material
    stretch, drift, other = (
        Trial(term, gain, fit()) for term, gain in ((STRETCH, 1300.0 - its_gain), (DRIFT, 20.0), (unsaid, its_gain))
    )
    fitted = [stretch, drift] if earlier else [stretch, other, drift]
    assert worthy(asked, fit(), fitted, [stretch, other, drift]) == ([stretch, drift] if named else [drift])
    second = replace(stretch, gain=1.1 * material)
    assert worthy(asked, fit(DRIFT), [second, other], [second, other]) == [second]


LIMIT = Term(AdcSaturation(), ("level_v",))


def trial(term: Term, gain: float) -> Trial:
    return Trial(term, gain, fit())


@pytest.mark.parametrize(("share", "named"), [(0.49, False), (0.51, True)])
@pytest.mark.parametrize("other", [STRETCH, FIELD, LIMIT], ids=["the network's", "a field", "the instrument's"])
def test_what_gains_a_part_of_an_instruments_gain_mends_its_form(share: float, named: bool, other: Term) -> None:
    asked, much = problem("temperature_drift"), 1e6
    found = [trial(GAIN, much), trial(replace(GAIN), 0.1 * much), trial(other, share * much), trial(DRIFT, 20.0)]
    instrument = instrument_worth_a_name(asked, fit(), found)
    assert instrument is found[0]
    # Its own other form may hold; rest frames show the drift.
    assert compatible_with_instrument(asked, found, instrument) == [t for t in found if named or t.term is not other]


def test_without_an_instrument_all_may_be_named() -> None:
    asked, much = problem(None), 1e6
    # A name that is in the fit already, one that isn't worth saying, and none of the instrument's.
    for current, term, gain in ((fit(GAIN), replace(GAIN), much), (fit(), GAIN, 10.0), (fit(), FIELD, much)):
        found = [trial(term, gain), trial(STRETCH, 0.1 * gain)]
        instrument = instrument_worth_a_name(asked, current, found)
        assert instrument is None
        assert compatible_with_instrument(asked, found, instrument) == found
