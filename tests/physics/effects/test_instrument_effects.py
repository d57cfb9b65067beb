"""Gain, crosstalk, saturation, and what they leave that no resistor network explains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ertskin.hardware.virtual.bench.nominal import nominal_sensor
from ertskin.physics.effects.adc_saturation import AdcSaturation
from ertskin.physics.effects.channel_gain import ChannelGain
from ertskin.physics.effects.contact_pressure_dependence import ContactPressureDependence
from ertskin.physics.effects.crosstalk import BEGINNINGS, Crosstalk
from ertskin.physics.effects.effect import AcquisitionEffect
from ertskin.physics.effects.registry import effect_classes
from ertskin.physics.effects.self_heating import SelfHeating
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy
from ertskin.physics.effects.temperature_drift import TemperatureDrift
from ertskin.physics.protocol import Protocol, electrode_pairs

PROTOCOL = Protocol.against_sink(electrode_pairs(5), 5, 1e-3)


@pytest.fixture
def readings():
    return PROTOCOL.readings(np.random.default_rng(0).uniform(100, 200, (2, 10)))


def test_gain_changes_its_channel_alone(readings) -> None:
    changed = ChannelGain(2, gain=0.1, offset_v=0.01).distorted_v(readings, PROTOCOL)
    np.testing.assert_allclose(changed[..., 2], 1.1 * readings[..., 2] + 0.01)
    np.testing.assert_array_equal(np.delete(changed, 2, axis=-1), np.delete(readings, 2, axis=-1))
    assert np.abs(PROTOCOL.split(changed)[1]).max() > 1e-4


def test_crosstalk_keeps_part_of_the_reading_before(readings) -> None:
    changed = Crosstalk(fraction=0.1).distorted_v(readings, PROTOCOL)
    assert changed[0, 3, 0] == pytest.approx(0.9 * readings[0, 3, 0] + 0.1 * readings[0, 2, 4])
    assert changed[0, 3, 2] == pytest.approx(0.9 * readings[0, 3, 2] + 0.1 * readings[0, 3, 1])
    by_injection = Crosstalk(fraction=0.1, before="injection").distorted_v(readings, PROTOCOL)
    assert by_injection[0, 3, 2] == pytest.approx(0.9 * readings[0, 3, 2] + 0.1 * readings[0, 2, 2])


@pytest.mark.parametrize(("begins", "kept"), [("discharged", 0.0), ("settled", 1.0)])
def test_crosstalk_may_begin_anew_with_every_injection(readings, begins, kept) -> None:
    changed = Crosstalk(fraction=0.1, begins=begins).distorted_v(readings, PROTOCOL)
    carried = Crosstalk(fraction=0.1).distorted_v(readings, PROTOCOL)
    np.testing.assert_allclose(changed[..., 0], (0.9 + 0.1 * kept) * readings[..., 0])
    np.testing.assert_array_equal(changed[..., 1:], carried[..., 1:])


@pytest.mark.parametrize("channel", [-1, 2])
@pytest.mark.parametrize("begins", BEGINNINGS)
@pytest.mark.parametrize(("before", "passes"), [("channel", False), ("channel", True), ("injection", False)])
def test_what_hardly_lasts_is_one_reading(before: str, begins: str, passes: bool, channel: int) -> None:
    scan = adjacent(APART)
    read = np.where(scan.taken, scan.readings(np.random.default_rng(1).uniform(100, 200, (2, 28))), 0.0)
    one = Crosstalk(fraction=0.1, before=before, begins=begins, passes=passes, channel=channel)
    np.testing.assert_allclose(
        one.distorted_v(read, scan), replace(one, lasting=1e-9).distorted_v(read, scan), rtol=1e-6, atol=1e-9
    )


def test_crosstalk_may_last_longer_than_a_reading(readings) -> None:
    """What a reading finds is the last one and a part of what that found: an exponential tail over all before."""
    changed = Crosstalk(fraction=0.1, lasting=0.5, begins="discharged").distorted_v(readings, PROTOCOL)
    before = readings[0, 3]
    found = 0.5 * before[2] + 0.25 * before[1] + 0.125 * before[0]
    assert changed[0, 3, 3] == pytest.approx(0.9 * before[3] + 0.1 * found)
    along = Crosstalk(fraction=0.1, lasting=0.5).distorted_v(readings, PROTOCOL)
    assert along[0, 0, 0] == pytest.approx(readings[0, 0, 0])


def test_crosstalk_may_be_of_a_few_readings_each_by_itself(readings) -> None:
    changed = Crosstalk(fraction=0.1, earlier=(0.3, 0.2), begins="discharged").distorted_v(readings, PROTOCOL)
    before = readings[0, 3]
    found = 0.5 * before[2] + 0.3 * before[1] + 0.2 * before[0]
    assert changed[0, 3, 3] == pytest.approx(0.9 * before[3] + 0.1 * found)
    assert changed[0, 3, 1] == pytest.approx(0.9 * before[1] + 0.1 * 0.5 * before[0])
    along = Crosstalk(fraction=0.1, earlier=(0.3, 0.2)).distorted_v(readings, PROTOCOL)
    assert along[0, 0, 0] == pytest.approx(readings[0, 0, 0])
    assert along[0, 0, 1] == pytest.approx(0.9 * readings[0, 0, 1] + 0.1 * readings[0, 0, 0])


def test_a_memory_told_reading_by_reading_begins_as_the_same_memory(readings) -> None:
    lasting = Crosstalk(fraction=0.02, shares=(0.0, 0.01, 0.0, 0.0, 0.0), lasting=0.2)
    told, *_ = lasting.freer(("fraction", "lasting"))
    assert told.free == ("fraction", "earlier[0]", "earlier[1]", "earlier[2]")
    np.testing.assert_allclose(
        told.effect.distorted_v(readings, PROTOCOL), lasting.distorted_v(readings, PROTOCOL), rtol=0, atol=2e-5
    )
    assert np.abs(lasting.distorted_v(readings, PROTOCOL) - readings).max() > 5e-3


def adjacent(measured: np.ndarray | None = None) -> Protocol:
    """Eight electrodes, driven and read by neighbours, in volt per milliampere."""
    pairs = np.stack([np.arange(8), (np.arange(8) + 1) % 8], axis=1)
    current = np.zeros((8, 8))
    current[np.arange(8), pairs[:, 0]], current[np.arange(8), pairs[:, 1]] = 1e-3, -1e-3
    return Protocol.differences(current, pairs, measured=measured)


APART = np.abs((np.arange(8)[:, None] - np.arange(8) + 4) % 8 - 4) > 1
"""Readings of electrodes that carry no current."""


@pytest.mark.parametrize("lasting", [0.0, 0.4])
def test_readings_that_are_not_taken_may_charge_the_capacitor(lasting) -> None:
    whole, part = adjacent(), adjacent(APART)
    contact_ohm = 300.0
    anyhow = part.readings(np.random.default_rng(1).uniform(100, 200, 28))
    network = part.reciprocal(anyhow) + 2 * contact_ohm
    effect = Crosstalk(fraction=0.1, lasting=lasting, driven_ohm=contact_ohm, passes=True)
    every, taken = whole.readings(network), part.readings(network)
    assert taken[APART] == pytest.approx(every[APART])
    assert part.with_passed(taken, contact_ohm) == pytest.approx(every)
    assert effect.distorted_v(taken, part)[APART] == pytest.approx(effect.distorted_v(every, whole)[APART])
    assert (effect.distorted_v(taken, part)[~APART] == 0).all()
    # The largest voltages are those across driven contacts: what comes right after them is changed most.
    change = effect.distorted_v(taken, part) - Crosstalk(fraction=0.1, lasting=lasting).distorted_v(taken, part)
    assert np.abs(change[2, 4]) > 5 * np.abs(change[2, 7])


def test_contacts_of_driven_electrodes_may_differ() -> None:
    whole, part = adjacent(), adjacent(APART)
    contact_ohm = np.linspace(50.0, 400.0, 8)
    anyhow = part.readings(np.random.default_rng(1).uniform(100, 200, 28))
    first, second = np.triu_indices(8, 1)
    network = part.reciprocal(anyhow) + contact_ohm[first] + contact_ohm[second]
    every, taken = whole.readings(network), part.readings(network)
    assert part.with_passed(taken, contact_ohm) == pytest.approx(every)
    effect = Crosstalk(fraction=0.1, driven_ohm=100.0, contacts_ohm=tuple(contact_ohm - 100.0), passes=True)
    assert effect.distorted_v(taken, part)[APART] == pytest.approx(effect.distorted_v(every, whole)[APART])
    with pytest.raises(ValueError, match="2 given, the scan has 8 electrodes"):
        Crosstalk(fraction=0.1, contacts_ohm=(1.0, 2.0), passes=True).distorted_v(taken, part)


def test_the_channel_found_first_may_be_but_the_one_that_keeps_the_most(readings) -> None:
    alone = Crosstalk(fraction=0.1, channel=2, shares=(0.0,) * 5)
    each = next(form for form in alone.freer(("fraction",)) if "shares[4]" in form.free)
    assert each.effect.shares == (0.0, 0.0, 0.1, 0.0, 0.0)
    assert each.effect.channel == -1
    np.testing.assert_array_equal(each.effect.distorted_v(readings, PROTOCOL), alone.distorted_v(readings, PROTOCOL))


def test_where_readings_are_not_taken_their_contacts_may_be_freed() -> None:
    for protocol, several in ((adjacent(APART), True), (adjacent(), False)):
        starts = Crosstalk.reading_starts(nominal_sensor(), protocol)
        forms = [form for start in starts for form in start.effect.freer(start.free)]
        passing = [form for form in forms if "contacts_ohm[7]" in form.free]
        assert bool(passing) is several
        assert all(form.effect.passes and "driven_ohm" not in form.free for form in passing)


def test_where_readings_are_not_taken_fits_begin_from_both_ways_of_passing_them() -> None:
    starts = Crosstalk.reading_starts(nominal_sensor(), adjacent(APART))
    assert {start.effect.passes for start in starts} == {True, False}
    assert not any(start.effect.passes for start in Crosstalk.reading_starts(nominal_sensor(), adjacent()))


def test_channels_may_keep_each_a_part_of_their_own(readings) -> None:
    shares = (0.1, 0.0, 0.2, 0.0, 0.0)
    changed = Crosstalk(shares=shares).distorted_v(readings, PROTOCOL)
    for channel, share in enumerate(shares):
        alike = Crosstalk(fraction=share).distorted_v(readings, PROTOCOL)
        np.testing.assert_allclose(changed[..., channel], alike[..., channel])
    *_, each = Crosstalk(fraction=0.1, shares=(0.0,) * 5).freer(("fraction",))
    assert each.free == tuple(f"shares[{k}]" for k in range(5))
    np.testing.assert_allclose(
        each.effect.distorted_v(readings, PROTOCOL), Crosstalk(fraction=0.1).distorted_v(readings, PROTOCOL)
    )


def test_one_of_several_parameters_is_known_by_its_number() -> None:
    effect = Crosstalk(shares=(0.1, 0.2)).changed({"shares[1]": 0.3, "fraction": 0.05, "shares[0]": 0.15})
    assert effect.shares == (0.15, 0.3)
    assert effect.value("shares[1]") == 0.3
    assert effect.value("fraction") == 0.05
    assert effect.known("shares[1]").unit == "1"
    with pytest.raises(ValueError, match="shares"):
        Crosstalk(shares=(0.1, 0.9))
    with pytest.raises(KeyError):
        effect.known("channel")
    with pytest.raises(ValueError, match="there are 2"):
        effect.changed({"shares[5]": 0.1})


def test_shares_are_as_many_as_channels(readings) -> None:
    with pytest.raises(ValueError, match="2 given, the scan has 5 channels"):
        Crosstalk(shares=(0.1, 0.2)).distorted_v(readings, PROTOCOL)


def test_its_size_is_what_channels_keep_whatever_else_there_is_several_of() -> None:
    effect = Crosstalk(shares=(0.02, -0.02), earlier=(0.3, 0.2), contacts_ohm=(300.0,) * 8, passes=True)
    assert effect.size("fraction") == pytest.approx(0.02)
    assert Crosstalk(fraction=0.01).size("fraction") == pytest.approx(0.01)
    assert effect.size("driven_ohm") == 0.0


def test_a_memory_lasts_or_is_told_reading_by_reading() -> None:
    with pytest.raises(ValueError, match="lasting, or told"):
        Crosstalk(lasting=0.5, earlier=(0.1,))


def test_an_unknown_beginning_is_refused() -> None:
    with pytest.raises(ValueError, match="begins"):
        Crosstalk(begins="anyhow")


@pytest.mark.parametrize("lasting", [0.0, 0.5])
def test_a_reading_that_is_lost_is_lost_to_those_that_keep_of_it_alone(readings, lasting: float) -> None:
    lost = np.array(readings)
    lost[0, 1, 2] = np.nan
    assert np.isnan(Crosstalk(fraction=0.01, channel=0, lasting=lasting).distorted_v(lost, PROTOCOL)).sum() <= (
        1 if lasting == 0 else lost[0].shape[0]
    )


def test_saturation_clips(readings) -> None:
    assert AdcSaturation(limit_v=0.1).distorted_v(readings, PROTOCOL).max() == pytest.approx(0.1)


@pytest.mark.parametrize("sharpness", [2.0, 5.0, 40.0])
def test_compression_is_the_part_by_which_the_level_falls_short_on_both_sides(sharpness: float) -> None:
    effect = AdcSaturation(compression=0.1, sharpness=sharpness, level_v=2.0)
    voltage = np.array([-1e6, -2.0, -0.02, 0.0, 0.02, 2.0, 1e6])
    changed = effect.distorted_v(voltage, PROTOCOL)
    np.testing.assert_allclose(changed, -changed[::-1])
    assert changed[5] == pytest.approx(1.8)
    assert changed[4] == pytest.approx(0.02, rel=1e-4)
    assert changed[6] == pytest.approx(effect.approached_v, rel=1e-9)
    assert effect.scaled_to(4.0).approached_v == pytest.approx(2 * effect.approached_v)


def test_a_hyperbolic_tangent_is_one_of_its_forms() -> None:
    voltage = np.linspace(-3.0, 3.0, 601)
    bent = 6.0 * np.tanh(voltage / 6.0)
    effect = AdcSaturation(compression=1 - bent[-1] / 3.0, sharpness=2.03, level_v=3.0)
    np.testing.assert_allclose(effect.distorted_v(voltage, PROTOCOL), bent, atol=0.005 * np.abs(voltage - bent).max())


def test_an_exponential_approach_from_a_knee_is_one_of_its_freer_forms() -> None:
    voltage, knee_v, span_v = np.linspace(-5.0, 5.0, 1001), 3.5, 5.0
    beyond_v = np.maximum(np.abs(voltage) - knee_v, 0.0)
    bent = np.sign(voltage) * (np.minimum(np.abs(voltage), knee_v) + span_v * (1 - np.exp(-beyond_v / span_v)))
    effect = AdcSaturation(compression=0.0419, sharpness=2.0, straight_share=0.6186, level_v=5.0)
    np.testing.assert_allclose(effect.distorted_v(voltage, PROTOCOL), bent, atol=0.03 * np.abs(voltage - bent).max())
    np.testing.assert_array_equal(effect.distorted_v(voltage[400:601], PROTOCOL), voltage[400:601])
    (first, *_) = AdcSaturation(compression=0.01).freer(("compression", "sharpness"))
    assert first.free == ("compression", "sharpness", "straight_share")


def test_a_limit_and_a_compression_stop_readings_at_the_lower_one() -> None:
    assert AdcSaturation(compression=0.1, level_v=2.0, limit_v=1.5).approached_v == 1.5
    assert AdcSaturation().approached_v == np.inf


def test_anisotropic_tensor_has_its_ratio_and_axis() -> None:
    effect = SheetAnisotropy(stretch_x=0.3, stretch_diagonal=0.4)
    xx, xy, yy = effect.tensor(np.zeros((1, 2)), np.array([[0.0, 0.0], [1.0, 1.0]]))[0]
    values, vectors = np.linalg.eigh([[xx, xy], [xy, yy]])
    assert values[1] / values[0] == pytest.approx(effect.ratio)
    assert values.prod() == pytest.approx(1.0)
    assert abs(vectors[:, 1] @ [np.cos(effect.angle_rad), np.sin(effect.angle_rad)]) == pytest.approx(1.0)


def test_the_axis_of_a_bowed_fabric_turns_along_the_sheet() -> None:
    extent_m = np.array([[0.0, 0.0], [0.2, 0.1]])
    bowed = SheetAnisotropy(stretch_x=0.3, turn_x_rad=0.2)
    for x_m, turn in ((0.0, -0.2), (0.1, 0.0), (0.15, 0.1), (0.2, 0.2)):
        xx, xy, yy = bowed.tensor(np.array([[x_m, 0.02]]), extent_m)[0]
        values, vectors = np.linalg.eigh([[xx, xy], [xy, yy]])
        assert values[1] / values[0] == pytest.approx(np.exp(0.3))
        assert abs(vectors[:, 1] @ [np.cos(turn), np.sin(turn)]) == pytest.approx(1.0)


def test_contacts_fall_under_pressure_and_sheet_drifts_in_time() -> None:
    pressed = ContactPressureDependence(sensitivity_per_pa=1e-4, bend=1.0)
    np.testing.assert_allclose(
        pressed.contact_resistance_ohm(np.full((1, 2), 300.0), np.array([[0.0, 1e4]]), np.zeros(1)), [[300.0, 150.0]]
    )
    drift = TemperatureDrift(rate_per_h=0.1).drift(np.array([0.0, 3600.0]))
    np.testing.assert_allclose(drift, [1.0, np.exp(0.1)], rtol=1e-4)


def test_no_load_takes_what_of_a_contact_is_fixed() -> None:
    effect = ContactPressureDependence(sensitivity_per_pa=1e-4, bend=1.0, fixed_share=0.4)
    load, resistance = np.array([[0.0, 1e4, 1e12]]), np.full((1, 3), 300.0)
    fallen = effect.contact_resistance_ohm(resistance, load, np.zeros(1))[0]
    np.testing.assert_allclose(fallen, [300.0, 300.0 * (0.4 + 0.6 / 2), 300.0 * 0.4], rtol=1e-6)


def test_contacts_may_fall_as_a_power_of_the_load_or_exponentially() -> None:
    load, resistance = np.array([[0.0, 1e3, 1e4]]), np.full((1, 3), 300.0)

    def fallen(bend: float) -> np.ndarray:
        effect = ContactPressureDependence(sensitivity_per_pa=1e-4, bend=bend)
        return effect.contact_resistance_ohm(resistance, load, np.zeros(1))[0] / 300.0

    np.testing.assert_allclose(fallen(2.0), (1 + 2e-4 * load[0]) ** -0.5)
    np.testing.assert_allclose(fallen(0.0), np.exp(-1e-4 * load[0]))
    np.testing.assert_allclose(fallen(1e-4), fallen(0.0), rtol=1e-3)


def test_a_contact_of_grains_conducts_as_a_power_of_the_paths_that_pressure_closes() -> None:
    effect = ContactPressureDependence(sensitivity_per_pa=1e-4, paths=9.0, order=2.0, percolates=True)
    load, resistance = np.array([[0.0, np.log(2) * 1e4, 1e9]]), np.full((1, 3), 300.0)
    fallen = effect.contact_resistance_ohm(resistance, load, np.zeros(1))[0]
    np.testing.assert_allclose(fallen, [300.0, 300.0 / (1 + 9 / 4), 300.0 / 10], rtol=1e-6)
    unsaid = ContactPressureDependence(sensitivity_per_pa=1e-4, percolates=True)
    assert unsaid.contact_resistance_ohm(resistance, load, np.zeros(1))[0, -1] == pytest.approx(300.0 / 11)


@pytest.mark.parametrize("bend", [0.0, 0.5, 2.0])
def test_its_fits_begin_where_the_law_they_are_freed_from_has_doubled_the_conductance(bend: float) -> None:
    simple = ContactPressureDependence(sensitivity_per_pa=1e-4, bend=bend)
    percolating = simple.freer(("sensitivity_per_pa", "bend"))[-1]
    assert isinstance(percolating.effect, ContactPressureDependence)
    assert percolating.effect.percolates
    assert percolating.effect.freer(percolating.free) == ()
    load, resistance = np.linspace(0, 4e4, 400), np.full(400, 300.0)
    both = [one.contact_resistance_ohm(resistance, load, np.zeros(400)) for one in (simple, percolating.effect)]
    doubled = [load[np.searchsorted(-fallen, -150.0)] for fallen in both]
    assert doubled[0] == pytest.approx(doubled[1], abs=200)


def every_instrument() -> list[AcquisitionEffect]:
    """The first start of every effect on the readings, and of its freed forms."""
    found = []
    for kind in effect_classes().values():
        if issubclass(kind, AcquisitionEffect):
            start = kind.reading_starts(nominal_sensor(), PROTOCOL)[0]
            freed = [form.effect for form in start.effect.freer(start.free)]
            found += [effect.scaled_to(200.0) for effect in (start.effect, *freed) if isinstance(effect, kind)]
    return found


@pytest.mark.parametrize("effect", every_instrument(), ids=lambda e: e.name)
def test_what_an_instrument_says_of_a_frame_hangs_on_no_other(effect: AcquisitionEffect) -> None:
    voltage = PROTOCOL.readings(np.random.default_rng(0).uniform(100, 200, (5, 10)))
    time_s, rows = np.array([0.0, 3.0, 5.0, 60.0, 400.0]), np.array([1, 4])
    whole = effect.read_v(voltage, PROTOCOL, time_s)
    np.testing.assert_allclose(effect.read_v(voltage[rows], PROTOCOL, time_s[rows]), whole[rows], rtol=1e-12)


def test_warmth_within_a_scan_is_whole_in_every_scan() -> None:
    voltage = PROTOCOL.readings(np.random.default_rng(0).uniform(100, 200, (3, 10)))
    heating = SelfHeating(rise=0.05)
    seen = heating.read_v(voltage, PROTOCOL, np.array([0.0, 3.0, 6.0]))
    np.testing.assert_array_equal(seen, heating.distorted_v(voltage, PROTOCOL))


def test_a_gain_comes_as_the_amplifier_warms() -> None:
    voltage = PROTOCOL.readings(np.random.default_rng(0).uniform(100, 200, (3, 10)))
    warming = ChannelGain(2, gain=0.1, cold=0.5, warms_s=100.0)
    seen = warming.read_v(voltage, PROTOCOL, np.array([0.0, 100.0, 1e6]))
    parts = 1.0 + 0.1 * (1.0 - 0.5 * np.exp([0.0, -1.0, -1e4]))
    np.testing.assert_allclose(seen[..., 2], parts[:, None] * voltage[..., 2])
