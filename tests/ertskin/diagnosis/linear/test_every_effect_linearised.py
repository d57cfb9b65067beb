"""The linearised skin follows the skin solved in full for every effect there is, and for one that is new."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from small_skin import SMALL, small_law, small_sensor, two_presses

from ertskin.diagnosis.fit.nonreciprocal import AcquisitionSignal
from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.physics.effects.adc_saturation import AdcSaturation
from ertskin.physics.effects.contact_drift import ContactDrift
from ertskin.physics.effects.crosstalk import Crosstalk
from ertskin.physics.effects.effect import (
    AcquisitionEffect,
    Effect,
    FoamEffect,
    MotionEffect,
    SheetEffect,
    Stage,
    Start,
    shown_by,
)
from ertskin.physics.effects.field_over_sheet import FieldOverSheet
from ertskin.physics.effects.hypothesis import Measured, Signal
from ertskin.physics.effects.registry import effect_classes
from ertskin.physics.effects.self_heating import SelfHeating
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

PAIRS = electrode_pairs(6)
SCAN = Protocol.against_sink(PAIRS, 6, 1e-4, injection_offset_s=np.linspace(0.0, 0.4, len(PAIRS)))
NOISE_V = 2e-3
EXAMPLES = 2
"""Starts of an effect that are looked at, in either form."""
WITHIN = 0.2
"""Of the largest change: a spot is no wider than the grid on which the sheet is resolved, pads shift by their rim."""


@pytest.fixture(scope="module")
def skin() -> Skin:
    return Skin.build(small_sensor(), SCAN, small_law(), np.linspace(200.0, 900.0, 6), 9000.0, (), SMALL)


@pytest.fixture(scope="module")
def history() -> History:
    return two_presses()


@pytest.fixture(scope="module")
def linear(skin: Skin, history: History) -> LinearSkin:
    return LinearSkin(skin, history, np.nan_to_num(skin.force_n(history)), np.arange(len(history)), None)


def examples(kind: type[Effect]) -> list[Effect]:
    """Some of the places where its fits begin, with what is screened at its typical size."""
    if kind.hypothesis.measured == Measured.CONTACT_PATH:
        return [ContactDrift(2, (0.0, 40.0), (0.0, 20.0))]
    starts = [*kind.reading_starts(small_sensor(), SCAN), *kind.force_starts()]
    known = kind.parameters()
    # Of every set of numbers that are free together.
    some = [s for k, s in enumerate(starts) if k < EXAMPLES or s.free not in {t.free for t in starts[:k]}]
    found = [s.effect.changed({key: known[key].typical for key in s.along}) for s in some]
    return [*found, replace(found[0], straight=True)] if isinstance(found[0], MotionEffect) else found


def every_example() -> list[Effect]:
    return [effect for kind in effect_classes().values() for effect in examples(kind)]


def freed_example(effect: Effect, free: tuple[str, ...], form: Start) -> Effect:
    """A form that is freed, what is free in it and wasn't before off by its typical size."""
    new = [key for key in form.free if key not in free and key in effect.parameters()]
    known = effect.parameters()
    moved = {key: min(form.effect.value(key) + known[key].typical, known[key].high) for key in new}
    return form.effect.changed(moved)


def every_freed_example() -> list[Effect]:
    """The forms that the first start of every effect may turn out to be."""
    found = []
    for kind in effect_classes().values():
        for start in [*kind.reading_starts(small_sensor(), SCAN), *kind.force_starts()][:1]:
            known = kind.parameters()
            begun = start.effect.changed({key: known[key].typical for key in start.along})
            fields = begun.beginnings(start.free) if isinstance(begun, FieldOverSheet) else ()
            found += [freed_example(begun, start.free, form) for form in (*begun.freer(start.free), *fields)]
    return found


def evidence_of(skin: Skin, history: History) -> Evidence:
    frames, (readings, pairs) = len(history), SCAN.orthonormal.shape
    return Evidence(
        sensor=skin.sensor,
        protocol=SCAN,
        history=history,
        scan_v=np.zeros((frames, pairs)),
        leftover_v=np.zeros((frames, *SCAN.shape), dtype=np.float32),
        noise_v=NOISE_V,
        leftover_noise_v=NOISE_V,
        air_n=float("nan"),
        saturated_v=None,
        excess_noise=np.zeros((pairs, 0)),
        traces=np.zeros((frames, pairs, 0)),
        leftover_share=1 - pairs / readings,
        repeats=np.zeros(SCAN.shape[1], dtype=np.intp),
    )


def held(skin: Skin, linear: LinearSkin, effect: Effect, within: float) -> None:
    """Scans and what no network explains change as the full skin's do, to ``within`` of the largest change."""
    protocol = skin.protocol
    changed = replace(skin, effects=(effect,))
    whole = Skin.build(
        skin.sensor, protocol, skin.piezo, skin.contact_resistance_ohm, skin.support_n_per_m, (effect,), SMALL
    )
    force_n = np.nan_to_num(whole.force_n(linear.history)) if isinstance(effect, FoamEffect) else linear.force_n
    before = skin.readings_v(linear.history, force_n).reshape(len(linear.history), -1)
    after = whole.readings_v(linear.history, force_n).reshape(len(linear.history), -1)
    known = replace(evidence_of(skin, linear.history), protocol=protocol)
    signal = AcquisitionSignal(known, linear, np.arange(len(linear.history)))
    if force_n is linear.force_n:
        seen = signal.scans(changed) - signal.scans(skin)
    else:
        seen = linear.scans(changed, force_n) - linear.scans(skin, force_n)
    change = (after - before) @ protocol.orthonormal
    beyond = (after - before) - change @ protocol.orthonormal.T
    largest = max(np.abs(change).max(), np.abs(beyond).max())
    assert largest > 0 or isinstance(effect, FoamEffect)
    np.testing.assert_allclose(seen, change, atol=within * largest + 1e-9)
    if shown_by(effect, Signal.NONRECIPROCAL):
        np.testing.assert_allclose(signal.leftover(changed), beyond, atol=within * largest + 1e-9)


@pytest.mark.parametrize(
    "effect",
    every_example(),
    ids=lambda e: e.name,
)
def test_an_effect_changes_both_alike(skin: Skin, linear: LinearSkin, effect: Effect) -> None:
    held(skin, linear, effect, WITHIN)


@pytest.mark.parametrize("effect", every_freed_example(), ids=lambda e: e.name)
def test_so_does_a_form_that_is_freed(skin: Skin, linear: LinearSkin, effect: Effect) -> None:
    held(skin, linear, effect, WITHIN)


@pytest.mark.parametrize(
    "effect",
    [e for e in every_example() if isinstance(e, AcquisitionEffect) and e.stage == Stage.ACQUISITION],
    ids=lambda e: e.name,
)
def test_what_acts_on_readings_alone_has_its_derivatives_by_readings(
    skin: Skin, linear: LinearSkin, effect: AcquisitionEffect
) -> None:
    others: tuple[Effect, ...] = (ContactDrift(2, (0.0, 40.0), (0.0, 20.0)), Crosstalk(fraction=0.01, channel=3))
    if effect.linear:
        others = (*others, AdcSaturation(compression=0.05, sharpness=2.0))
    begun = replace(skin, effects=(*others, effect))
    more = {key: effect.value(key) + known.typical for key, known in effect.parameters().items() if known.defining}
    moved = replace(skin, effects=(*others, effect.changed(more)))
    known = replace(evidence_of(skin, linear.history), leftover_v=np.ones((len(linear.history), *SCAN.shape)))
    signal = AcquisitionSignal(known, linear, np.arange(0, len(linear.history), 2))
    scans, beyond = signal.derivatives(begun, [moved, begun])
    expected = signal.scans(moved) - signal.scans(begun)
    assert np.abs(expected).max() > 0
    np.testing.assert_allclose(scans[..., 0], expected, atol=0.02 * np.abs(expected).max())
    expected = signal.residual(begun) - signal.residual(moved)
    np.testing.assert_allclose(beyond[0], expected, atol=1e-6 * np.abs(expected).max())
    assert not scans[..., 1].any()
    assert not beyond[1].any()


@pytest.mark.parametrize("others", [(), (SelfHeating(crowded_rise=-0.03, lasts_s=12.0),)], ids=["cold", "as warm"])
def test_a_skin_linearised_while_it_is_warm_follows_the_whole_one(
    skin: Skin, history: History, others: tuple[Effect, ...]
) -> None:
    warm = replace(skin, effects=(SelfHeating(crowded_rise=-0.05, lasts_s=12.0),))
    force_n = np.nan_to_num(skin.force_n(history))
    linear = LinearSkin(warm, history, force_n, np.arange(len(history)), None)
    before, after = (
        SCAN.whitened(one.pair_resistance_ohm(history, force_n)) for one in (warm, replace(warm, effects=others))
    )
    change = after - before
    np.testing.assert_allclose(linear.scans(warm, force_n), before, atol=0.1 * np.abs(change).max())
    found = linear.scans(replace(warm, effects=others), force_n) - linear.scans(warm, force_n)
    np.testing.assert_allclose(found, change, atol=0.1 * np.abs(change).max())


def test_every_effect_that_is_searched_for_was_looked_at() -> None:
    assert not [kind.name for kind in effect_classes().values() if not examples(kind)]


@dataclass(frozen=True)
class Grain(SheetEffect):
    """A new effect of the sheet: one half of it conducts better along x, and less in all."""

    def conductivity_s(self, conductivity_s: np.ndarray, position_m: np.ndarray, extent_m: np.ndarray) -> np.ndarray:
        middle, span = extent_m.mean(axis=0), extent_m[1] - extent_m[0]
        share = 0.5 + 0.5 * np.tanh(4 * ((position_m - middle) / span)[:, 0])
        tensor = np.stack([np.exp(0.04 * share), 0.01 * share, np.exp(-0.06 * share)], axis=1)
        return conductivity_s[..., None] * tensor


def test_a_new_effect_of_the_sheet_needs_no_word_outside_its_file(skin: Skin, linear: LinearSkin) -> None:
    grain = replace(skin, effects=(Grain(),))
    full = grain.readings_v(linear.history, linear.force_n) - skin.readings_v(linear.history, linear.force_n)
    change = full.reshape(len(full), -1) @ SCAN.orthonormal
    seen = linear.scans(grain) - linear.scans(skin)
    np.testing.assert_allclose(seen, change, atol=0.1 * np.abs(change).max())


def test_about_a_sheet_with_grain_it_is_the_skin_too(skin: Skin, history: History) -> None:
    grain = replace(skin, effects=(Grain(),))
    force_n = np.nan_to_num(grain.force_n(history))
    linear = LinearSkin(grain, history, force_n, np.arange(len(history)), None)
    full = grain.readings_v(history, force_n)
    scans = full.reshape(len(full), -1) @ SCAN.orthonormal
    np.testing.assert_allclose(linear.scans(grain), scans, atol=5e-3 * np.ptp(scans, axis=0).max())
