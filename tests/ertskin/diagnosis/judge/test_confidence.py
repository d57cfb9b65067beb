"""A name is less sure where misfit stays, where another effect's form may be mended, where the instrument errs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from ertskin.diagnosis.contract.claims import Claim, Reason
from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.force.claims import ForceAnswer
from ertskin.diagnosis.judge.answer import Case, _depends_on, _instrument_claims, _verdict
from ertskin.diagnosis.judge.confidence import (
    AT_ONCE,
    at_once,
    left_beyond,
    left_over,
    left_over_of_force,
    mending,
    misreading,
    noisy,
    of_maps,
    overshadowed,
    reasoned,
    static_only,
)
from ertskin.diagnosis.judge.held_out import Predictions
from ertskin.diagnosis.judge.repeatability import Repeatability
from ertskin.physics.effects.channel_gain import ChannelGain
from ertskin.physics.effects.contact_drift import ContactDrift
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.electrode_displacement import ElectrodeDisplacement
from ertskin.physics.effects.indenter_offset import IndenterOffset
from ertskin.physics.effects.nonlinear_foam import NonlinearFoam
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.scan_skew import ScanSkew
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity

ODDS = DEFAULT.significant_gain / DEFAULT.evidence_discount
"""Logarithm of the odds for a name against what has none and gains nothing."""


def claim(effect: Effect, alone: float) -> Claim:
    return Claim(effect, 0.95, alone, {})


def leaving(misfit: float) -> Callable[[Effect], float]:
    """So much of the noise is left against every effect."""
    return lambda effect: misfit


def test_what_stays_unexplained_is_shared_by_all_but_the_load_cells_names() -> None:
    claims = [claim(SheetAnisotropy(stretch_x=0.1), 2.0), claim(NonlinearFoam(stiffening=0.5), 2.0)]
    assert left_over(claims, 3.0, leaving(1.0), DEFAULT) == claims
    lowered, kept = left_over(claims, 3.0, leaving(2.236), DEFAULT)
    assert lowered.confidence == pytest.approx(0.95 * 0.302**2, abs=0.01)
    assert kept.confidence == 0.95


def predicted(**counted: float) -> Predictions:
    """Presses held out of which 3.0 of the noise is left before, 2.236 after, less what is ``counted`` as noise."""
    return Predictions(np.arange(4), np.full((4, 3), 3.0), np.full((4, 3), 2.236), **counted)


def test_presses_that_do_not_repeat_speak_against_names_of_places_alone() -> None:
    differ = Repeatability(5e-4, 0.09, ratio=1.05, without=2.236, between_repeats=0.9)
    found = predicted()
    assert found.left_against(SheetAnisotropy(), differ) == pytest.approx(2.236)
    assert found.left_against(PiezoHysteresis(), differ) == pytest.approx(1.05)
    assert found.left_against(PiezoHysteresis(), None) == pytest.approx(2.236)
    # A field's map is none of what scatters, and what a field may be elsewhere speaks against no other name.
    unknown = predicted(known_ratio=1.01, where_pressed_ratio=1.5)
    assert unknown.left_against(PiezoInhomogeneity(), differ) == pytest.approx(2.236)
    assert unknown.left_against(PiezoHysteresis(), differ) == pytest.approx(1.01)


def test_a_field_answers_for_presses_that_nobody_could_predict() -> None:
    found = predicted(known_ratio=1.0, where_pressed_ratio=1.5)
    assert found.left_against(PiezoHysteresis(), None) == 1.0
    assert found.left_against(PiezoInhomogeneity(), None) == pytest.approx(2.236)


def test_a_field_of_the_sheet_does_not_answer_for_one_that_presses_alone_show() -> None:
    assert predicted(known_ratio=1.0, where_pressed_ratio=1.5).left_against(SheetInhomogeneity(), None) == 1.5
    assert predicted(known_ratio=1.0).left_against(SheetInhomogeneity(), None) == pytest.approx(2.236)


def test_a_field_that_places_tell_of_is_as_sure_as_they_make_it() -> None:
    """Half of the rms is predicted, and one number for every place leaves next to nothing of the presses fitted."""
    field = claim(PiezoInhomogeneity(amplitude=0.3), 3.0)
    (predicting,) = left_over([field], 3.0, leaving(1.6), DEFAULT)
    (told,) = left_over([replace(field, misfits_by_place=(3.0, 1.06))], 3.0, leaving(1.6), DEFAULT)
    assert not predicting.by_place
    assert told.by_place
    assert told.confidence == pytest.approx(0.95 * 0.95, abs=0.02)
    assert of_maps([predicting])[0].confidence < 0.1
    assert of_maps([told]) == [told]


def test_a_map_that_predicts_is_kept() -> None:
    field = replace(claim(PiezoInhomogeneity(amplitude=0.3), 3.0), misfits_by_place=(3.0, 1.5))
    (found,) = left_over([field], 3.0, leaving(1.04), DEFAULT)
    assert not found.by_place
    assert found.confidence == 0.95


def test_where_presses_land_answers_for_misfit_as_any_place_does() -> None:
    claims = [claim(IndenterOffset(dx_m=1e-3), 2.0), claim(NonlinearFoam(stiffening=0.5), 2.0)]
    landing, foam = left_over(claims, 3.0, leaving(2.236), DEFAULT)
    assert landing.confidence == pytest.approx(0.95 * 0.302**2, abs=0.01)
    assert foam.confidence == 0.95


def test_a_memory_is_as_sure_as_what_lags_makes_it() -> None:
    claims = [claim(PiezoCreep(fraction=0.1), 2.0), claim(PiezoHysteresis(width=0.1), 2.0)]
    assert at_once(claims, [200.0, None], DEFAULT)[0].confidence == pytest.approx(0.95)
    creep, loop = at_once(claims, [0.0, None], DEFAULT)
    assert creep.confidence == pytest.approx(0.95 / (1 + np.exp(ODDS)))
    assert creep.alternatives == ((AT_ONCE, pytest.approx(0.95 - creep.confidence)),)
    assert loop == claims[1]


def test_foam_that_gives_way_is_doubted_where_the_sheet_feels_what_the_load_cell_does_not() -> None:
    foam = claim(NonlinearFoam(stiffening=-0.1), 2.0)
    sure, even, doubted = misreading([replace(foam, misread=gain) for gain in (-80.0, 0.0, 80.0)], DEFAULT)
    assert sure.confidence == pytest.approx(0.95)
    assert even.confidence == pytest.approx(0.95 / (1 + np.exp(-ODDS)))
    assert doubted.confidence < 1e-4
    assert misreading([foam], DEFAULT) == [foam]


def test_names_of_the_instrument_answer_for_what_no_network_explains() -> None:
    claims = [claim(ChannelGain(channel=3, gain=0.1), 2.0), claim(SheetAnisotropy(stretch_x=0.1), 2.0)]
    assert left_beyond(claims, 3.0, 1.0, DEFAULT) == claims
    lowered, kept = left_beyond(claims, 3.0, 2.236, DEFAULT)
    assert lowered.confidence == pytest.approx(0.95 * 0.302**2, abs=0.01)
    assert kept.confidence == 0.95


def test_a_foam_that_leaves_force_unexplained_is_less_sure() -> None:
    lost_motion = [claim(NonlinearFoam(stiffening=0.5), 1.5)]
    assert left_over_of_force(lost_motion, 2.0, 1.0, DEFAULT) == lost_motion
    assert left_over_of_force(lost_motion, 2.0, 1.5, DEFAULT)[0].confidence == pytest.approx(0.95 * 0.3815, abs=0.01)


def test_a_name_of_a_noisy_channel_is_half_as_sure() -> None:
    gains = [claim(ChannelGain(gain=0.01, channel=channel), 2.0) for channel in (3, 8)]
    assert [c.confidence for c in noisy(gains, {8: 2.9}, DEFAULT)] == pytest.approx([0.95, 0.475])


def test_fields_are_as_sure_as_fields_have_been_right() -> None:
    field, loop = of_maps(
        [replace(claim(effect, 2.0), confidence=0.8) for effect in (PiezoInhomogeneity(), PiezoHysteresis())]
    )
    assert field.confidence == pytest.approx(0.328, abs=1e-3)
    assert (field.named, loop.named) == (0.8, 0.8)
    assert field.as_builtins()["name_confidence"] == 0.8
    assert loop.confidence == 0.8


def test_presses_predicted_worse_than_by_the_uncorrected_simulator_are_spoilt() -> None:
    before, little, more = (np.full((4, 3), size) for size in (2.0, 2.05, 2.2))
    held = np.arange(4)
    assert not Predictions(held, before, little).spoilt(DEFAULT)
    # However little is known of a field where nothing pressed: a network would learn what is predicted there.
    unknown = Predictions(held, before, more, known_ratio=1.0)
    assert unknown.spoilt(DEFAULT)


def test_a_small_field_beside_strong_kin_may_only_mend_its_form() -> None:
    strong, small = claim(IndenterOffset(dx_m=1e-3), 3.0), claim(PiezoInhomogeneity(amplitude=0.05), 1.2)
    kept, doubted = mending([strong, small], DEFAULT)
    assert kept == strong
    assert doubted.confidence == pytest.approx(0.475)
    assert doubted.alternatives == (("indenter_offset", pytest.approx(0.475)),)
    equal = claim(PiezoInhomogeneity(amplitude=0.3), 2.5)
    assert mending([strong, equal], DEFAULT) == [strong, equal]
    felt = replace(strong, by_force=True)
    assert mending([felt, small], DEFAULT) == [felt, small]


def test_a_small_effect_of_few_numbers_holds_its_own() -> None:
    claims = [claim(PiezoCreep(fraction=0.2, remembers_air=True), 3.0), claim(PiezoHysteresis(width=0.02), 1.2)]
    assert mending(claims, DEFAULT) == claims


def test_contacts_that_wander_mend_what_rest_shows_alone() -> None:
    drift = claim(ContactDrift(2, (0.0, 40.0), (0.0, 20.0)), 1.05)
    offset, creep = claim(IndenterOffset(dx_m=1e-3), 3.0), claim(PiezoCreep(fraction=0.2, remembers_air=True), 3.0)
    assert mending([offset, drift], DEFAULT) == [offset, drift]
    assert mending([creep, drift], DEFAULT)[1].confidence < 0.5


def test_a_small_field_that_rest_shows_too_holds_its_own() -> None:
    claims = [claim(ElectrodeDisplacement(along_m=3e-4), 3.0), claim(SheetInhomogeneity(amplitude=0.02), 1.2)]
    assert mending(claims, DEFAULT) == claims


def test_a_small_gain_in_the_network_means_little_beside_much_that_is_none() -> None:
    sheet = [claim(SheetAnisotropy(stretch_x=0.1), 1.2)]
    assert overshadowed(sheet, (6624, 276), (1.2, 1.0), 1.0, DEFAULT) == sheet
    assert overshadowed(sheet, (6624, 276), (1.2, 1.0), 1.5, DEFAULT)[0].confidence < 0.05
    assert overshadowed(sheet, (6624, 276), (10.0, 1.0), 1.06, DEFAULT)[0].confidence > 0.9
    instrument = [claim(ScanSkew(speed_m_per_s=1e-3), 1.2)]
    assert overshadowed(instrument, (6624, 276), (1.2, 1.0), 1.5, DEFAULT) == instrument


def test_a_sheet_that_explains_what_stands_but_not_what_presses_change_is_less_sure() -> None:
    rng = np.random.default_rng(3)
    rest = np.arange(60) % 3 == 0
    noise = rng.standard_normal((60, 30))
    static, pressed = 1.5 * rng.standard_normal(30), np.where(rest, 0.0, 1.0)[:, None] * rng.standard_normal(30)
    claims = [claim(SheetAnisotropy(stretch_x=0.1), 1.8), claim(PiezoCreep(fraction=0.2), 1.8)]
    assert static_only(claims, (noise + static + pressed, noise), rest, DEFAULT) == claims
    assert static_only(claims, (noise + static, noise), rest, DEFAULT) == claims
    doubted, kept = static_only(claims, (noise + static + pressed, noise + pressed), rest, DEFAULT)
    assert doubted.confidence == pytest.approx(0.475)
    assert kept.confidence == 0.95
    residuals = (noise + static + pressed, noise + pressed)
    shown = static_only(claims, residuals, rest, DEFAULT, {SheetAnisotropy.name})
    assert shown == claims
    much = (noise + 10 * static + pressed, noise + pressed)
    assert static_only(claims, much, rest, DEFAULT) == claims, "little beside what is explained at rest"


def test_a_limit_is_half_as_sure_where_the_readings_below_it_are_not_straight() -> None:
    protocol = SimpleNamespace(adc_volts_per_count=1e-4)
    evidence = SimpleNamespace(saturated_v=5.0, leftover_ratio=1.3, protocol=protocol)
    straight, curved = (
        SimpleNamespace(evidence=evidence, instrument_off=off, criteria=DEFAULT) for off in (False, True)
    )
    assert _instrument_claims(straight)[0].confidence == DEFAULT.measured_confidence  # type: ignore[arg-type]
    assert _instrument_claims(curved)[0].confidence == 0.5 * DEFAULT.measured_confidence  # type: ignore[arg-type]
    assert _instrument_claims(straight)[0].parameters["limit_v"].value == 5.0  # type: ignore[arg-type]


def test_a_rule_that_makes_a_claim_less_sure_leaves_its_reason() -> None:
    before = [Claim(PiezoHysteresis(width=0.1), 0.9, 2.0, {}), Claim(PiezoCreep(fraction=0.1), 0.8, 1.5, {})]
    after = [replace(before[0], confidence=0.6), before[1]]
    found = reasoned(before, after, "left_over", "part of the misfit stays")
    assert [claim.reasons for claim in found] == [(Reason("left_over", 0.9, 0.6, "part of the misfit stays"),), ()]
    assert found[0].as_builtins()["reasons"][0]["after"] == 0.6


@pytest.mark.parametrize(("gain", "misread"), [(20.0, True), (10.0, False), (None, False)])
def test_a_load_cell_that_misreads_is_said_and_nothing_is_wholly_explained(gain: float | None, misread: bool) -> None:
    foam = replace(claim(NonlinearFoam(stiffening=-0.1), 2.0), misread=gain, by_force=True)
    case: Any = MagicMock(criteria=DEFAULT, instrument_off=False, faulty=(), repeating=(), noisy={})
    case.force = ForceAnswer((foam,), 0.03, 0.01, off=False)
    case.found = MagicMock(ratio_before=1.0, ratio_after=1.0)
    case.misread = Case.misread.fget(case)  # type: ignore[attr-defined]
    case.selection.specimen = None
    case.evidence.criteria = DEFAULT
    assert case.misread is misread
    assert _verdict(case, [foam], False) == ("partly_explained" if misread else "explained")
    assert _depends_on(case, [], "explained", False, []) == (("force",) if misread else ())
