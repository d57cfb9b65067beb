"""Every effect says by itself how a diagnosis looks for it."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.hardware.virtual.bench.nominal import nominal_sensor
from ertskin.physics.effects.effect import Effect, Start, shown_by
from ertskin.physics.effects.hypothesis import Measured, Need, Signal
from ertskin.physics.effects.registry import effect_classes, effects_shown_by, measured_as
from ertskin.physics.effects.self_heating import SelfHeating
from ertskin.physics.protocol import Protocol, electrode_pairs

SENSOR = nominal_sensor()
PAIRS = electrode_pairs(24)
PROTOCOL = Protocol.against_sink(PAIRS, 24, 1e-4, injection_offset_s=np.linspace(0.0, 0.4, len(PAIRS)))
KINDS = pytest.mark.parametrize("kind", effect_classes().values(), ids=lambda k: k.name)


def starts_of(kind: type[Effect]) -> dict[str, list[Start]]:
    return {
        "force": list(kind.force_starts()),
        "specimen": list(kind.specimen_starts()),
        "coupon": list(kind.coupon_starts()),
        "readings": list(kind.reading_starts(SENSOR, PROTOCOL)),
    }


@KINDS
def test_an_effect_says_what_shows_it_and_along_what(kind: type[Effect]) -> None:
    known = kind.hypothesis
    assert known.axes
    assert known.signals
    assert len(set(known.axes)) == len(known.axes)
    assert set(known.held) | set(known.also_in_readings) <= set(kind.parameters())
    assert known.field == hasattr(kind(), "nodes")
    # Readings may do instead, where they show it as well.
    assert (Need.FORCES in known.needs) == (Signal.FORCE in known.signals and Signal.READINGS not in known.signals)


@KINDS
def test_it_is_searched_from_its_starts_in_each_signal_or_measured(kind: type[Effect]) -> None:
    known, starts = kind.hypothesis, starts_of(kind)
    assert bool(starts["force"]) == (Signal.FORCE in known.signals)
    assert bool(starts["specimen"]) == (Signal.SPECIMEN in known.signals)
    assert bool(starts["coupon"]) == (Signal.COUPON in known.signals)
    searched = {Signal.READINGS, Signal.NONRECIPROCAL} & set(known.signals)
    assert bool(starts["readings"]) == bool(searched) or known.measured is not None
    assert any(starts.values()) or known.measured is not None


@KINDS
def test_a_start_is_an_effect_with_something_free(kind: type[Effect]) -> None:
    for start in (start for several in starts_of(kind).values() for start in several):
        assert isinstance(start.effect, kind)
        assert start.free
        assert set(start.along) <= set(start.free)
        assert all(start.effect.known(key) for key in start.free)
        whole = any(getattr(start.effect, key) != p.neutral for key, p in kind.parameters().items() if p.defining)
        assert start.along or whole


@KINDS
def test_freeing_its_form_comes_to_an_end_and_repeats_none(kind: type[Effect]) -> None:
    left = [(start.effect, start.free) for several in starts_of(kind).values() for start in several]
    for _ in range(8):
        left = [(form.effect, form.free) for effect, free in left for form in effect.freer(free)]
        for effect, free in left:
            assert isinstance(effect, kind)
            assert all(effect.known(key) for key in free)
    assert not left


def test_what_is_measured_belongs_to_one_effect() -> None:
    assert [measured_as(quantity).hypothesis.measured for quantity in Measured] == list(Measured)
    measured = [kind.hypothesis.measured for kind in effect_classes().values()]
    assert all(measured.count(quantity) == 1 for quantity in Measured)


def test_every_signal_shows_something() -> None:
    for signal in Signal:
        assert effects_shown_by(signal), signal


def test_the_sheet_warms_over_the_scan_and_settles() -> None:
    heated = SelfHeating(rise=-0.01, settle_scans=0.1)
    readings = np.ones((1, *PROTOCOL.shape))
    change = heated.distorted_v(readings, PROTOCOL)[0, :, 0]
    moment = np.arange(len(PAIRS)) / len(PAIRS)
    np.testing.assert_allclose(np.log(change), -0.01 * (1 - np.exp(-moment / 0.1)), rtol=1e-6, atol=1e-12)


def test_a_stronger_current_warms_more() -> None:
    current = np.array(PROTOCOL.injection_current_a)
    current[: len(PAIRS) // 2] *= 2
    early = Protocol(current, PROTOCOL.measurement, PROTOCOL.pairs, PROTOCOL.injection_offset_s)
    warmth = SelfHeating(rise=0.01, settle_scans=0.2).within_scan(early)
    half = len(PAIRS) // 2
    # The mean power is that of four and one: at first the sheet comes to 4 / 2.5, then to 1 / 2.5.
    assert warmth[half] == pytest.approx(1.6 * (1 - np.exp(-0.5 / 0.2)), rel=0.01)
    assert warmth[-1] == pytest.approx(0.4 + (warmth[half] - 0.4) * np.exp(-0.5 / 0.2), rel=0.02)


def test_scans_that_follow_one_another_warm_the_sheet_through_and_a_pause_cools_it() -> None:
    heated = SelfHeating(crowded_rise=-0.01, lasts_s=20.0)
    time_s = np.concatenate([np.arange(200.0), [239.0]])
    course = heated.course(time_s)
    each = -np.expm1(-1 / 20)
    assert course[0] == pytest.approx(each)
    assert course[199] == pytest.approx(1.0, rel=1e-3)
    assert course[200] == pytest.approx(course[199] * np.exp(-40 / 20) + each)
    # Times kept in whole seconds of scans that follow faster still have a pace.
    assert heated.course(np.repeat(np.arange(20.0), 3)).max() > 0


def test_warmth_that_stays_is_where_current_crowds() -> None:
    heated = SelfHeating(crowded_rise=-0.01, lasts_s=20.0)
    pad, middle = SENSOR.electrode_center_m[0] + np.array([3e-3, 3e-3]), SENSOR.outline_m.mean(axis=0)
    found = heated.warmth(np.array([pad, middle]), np.arange(50.0), SENSOR, PROTOCOL)
    assert found is not None
    pattern, course = found
    assert pattern[0] > 2 * pattern[1] > 0
    np.testing.assert_allclose(course, heated.course(np.arange(50.0)))
    assert SelfHeating(rise=0.01).warmth(np.array([pad]), np.arange(50.0), SENSOR, PROTOCOL) is None


def test_only_what_comes_within_a_scan_shows_beyond_networks() -> None:
    assert shown_by(SelfHeating(rise=0.01), Signal.NONRECIPROCAL)
    assert shown_by(SelfHeating, Signal.NONRECIPROCAL)
    assert not shown_by(SelfHeating(crowded_rise=0.01), Signal.NONRECIPROCAL)
    assert shown_by(SelfHeating(rise=0.01, crowded_rise=0.01), Signal.NONRECIPROCAL)
