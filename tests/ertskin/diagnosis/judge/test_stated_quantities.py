"""Intervals of quantities follow from the parameters' covariance; maps lie in the sheet."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ertskin.diagnosis.contract.claims import QUANTILE, Claim, Estimate
from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.judge.known_map import where_pressed
from ertskin.diagnosis.judge.map_probability import Places
from ertskin.diagnosis.judge.quantities import (
    Spread,
    as_sure_as_all,
    field_map,
    largest_alone,
    quantities,
    spread_of,
    standard_of,
    stated,
)
from ertskin.diagnosis.output.summary import how_sure
from ertskin.diagnosis.search.smooth_fields import node_shape
from ertskin.hardware.virtual.bench.nominal import nominal_sensor
from ertskin.physics.effects.adc_saturation import AdcSaturation
from ertskin.physics.effects.contact_drift import ContactDrift
from ertskin.physics.effects.indenter_offset import IndenterOffset
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy
from ertskin.physics.effects.standard import Standard
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol, electrode_pairs

SENSOR = nominal_sensor()
STANDARD = Standard(lambda p: 1 / (1 + p / 1e4), 1e5, point_m=SENSOR.taxel_m, extent_m=SENSOR.extent_m)


def test_an_interval_follows_from_the_covariance() -> None:
    # The ratio is exp(hypot): along the pair its derivative is the ratio, across it none.
    effect = SheetAnisotropy(stretch_x=0.6, stretch_diagonal=0.8)
    along, across = np.array([0.6, 0.8]), np.array([-0.8, 0.6])
    covariance = 0.05**2 * np.outer(along, along) + 0.3**2 * np.outer(across, across)
    found = quantities(effect, STANDARD, Spread(("stretch_x", "stretch_diagonal"), (covariance,)))["conductance_ratio"]
    assert found.high - found.value == pytest.approx(QUANTILE * 0.05 * np.exp(1.0), rel=0.02)


def test_the_wider_of_two_covariances_counts_and_none_is_narrower_than_a_form() -> None:
    effect, free = PiezoHysteresis(width=0.1), ("width",)
    half = [
        quantities(effect, STANDARD, Spread(free, tuple(np.array([[e**2]]) for e in errors)))["loop_width"]
        for errors in ((0.01,), (0.01, 0.03), (0.0,))
    ]
    wide, wider, least = (e.high - e.value for e in half)
    assert wider == pytest.approx(3 * wide, rel=0.05)
    assert least == pytest.approx(PiezoHysteresis.form_error * half[2].value)


def test_a_shift_is_known_to_a_part_of_all_of_it_in_each_direction() -> None:
    standard, known = replace(STANDARD, pressed_m=SENSOR.taxel_m), Spread(("dx_m", "dy_m"), (np.zeros((2, 2)),))
    found = quantities(IndenterOffset(dx_m=5e-4, dy_m=-8e-6), standard, known)
    for key in ("dx_m", "dy_m"):
        assert found[key].high - found[key].value == pytest.approx(IndenterOffset.form_error * 5e-4, rel=1e-3)


def test_a_claim_states_its_map_in_the_sheet() -> None:
    effect = PiezoInhomogeneity(amplitude=0.5, x_m=0.04, y_m=0.06, radius_m=0.02)
    claim = Claim(effect, 0.9, 1.3, {"amplitude": Estimate(0.5, 0.4, 0.6, "1")})
    said = stated(claim, STANDARD, Spread.of(claim.parameters), SENSOR).as_builtins()
    point, value = np.array(said["map"]["point_m"]), np.array(said["map"]["value"])
    assert value == pytest.approx(effect.logarithm(point, SENSOR.extent_m), abs=1e-4)
    assert ((point > SENSOR.extent_m[0]) & (point < SENSOR.extent_m[1])).all()
    assert said["quantities"]["log_spread"]["low"] < said["quantities"]["log_spread"]["high"]
    assert claim.as_builtins()["map"] is None
    assert field_map(PiezoHysteresis(width=0.1), SENSOR) is None


def test_a_limit_that_was_read_off_is_stated_in_volt() -> None:
    claim = Claim(AdcSaturation(limit_v=4.0), 0.97, 1.3, {"limit_v": Estimate(4.0, 3.99, 4.01, "V")})
    said = stated(claim, STANDARD, Spread.of(claim.parameters), SENSOR).as_builtins()
    assert said["quantities"]["limit_v"]["value"] == 4.0
    assert said["quantities"]["limit_v"]["unit"] == "V"


def test_the_standard_is_the_recordings() -> None:
    depth = np.array([0, 1, 2, 3, 2, 0])[:, None] * 1e-3
    phase = np.array([0, 1, 1, 1, 3, 0], np.uint8)
    nothing = np.full((6, 1), np.nan)
    history = History(np.arange(6.0), np.zeros(6, int), phase, np.zeros((6, 1, 2)), depth, nothing)
    protocol = Protocol.against_sink(electrode_pairs(24), 24, 1e-4, scan_s=0.4)
    found = standard_of(SENSOR, protocol, history)
    assert (found.deepest_m, found.step_m, found.scan_s) == (3e-3, pytest.approx(1e-3), 0.4)


def test_of_contacts_that_drift_the_surest_states_how_far_the_farthest_goes() -> None:
    known = replace(STANDARD, contact_ohm=np.array([200.0, 500.0, 300.0]))
    drifts = {0: 0.9, 1: 0.9, 2: 0.2}
    paths = {0: (0.0, -50.0), 1: (0.0, 100.0), 2: (0.0, 150.0)}
    claims = [
        stated(Claim(ContactDrift(k, (0.0, 300.0), paths[k]), sure, 1.1, {}), known, Spread.of({}))
        for k, sure in drifts.items()
    ]
    found = largest_alone(claims)
    assert [list(claim.quantities) for claim in found] == [["largest_share_300_s"], [], []]
    assert found[0].quantities["largest_share_300_s"].value == pytest.approx(-0.25)
    assert ContactDrift(0, (0.0, 300.0), (-200.0, 0.0)).quantities(known) == {}


def test_the_spread_of_places_lies_in_its_interval_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    found = [spread_of(0.2 * rng.standard_normal(6)) for _ in range(2000)]
    assert np.mean([one.low <= 0.2 <= one.high for one in found]) == pytest.approx(0.9, abs=0.02)


def test_a_map_states_the_sensing_points_too() -> None:
    effect = PiezoInhomogeneity(amplitude=0.5, x_m=0.04, y_m=0.06, radius_m=0.02)
    field = field_map(effect, SENSOR)
    assert field is not None
    taxels = field.as_builtins()["taxels"]
    assert taxels["point_m"] == pytest.approx(SENSOR.taxel_m)
    assert taxels["value"] == pytest.approx(effect.logarithm(SENSOR.taxel_m, SENSOR.extent_m), abs=1e-4)


@pytest.mark.parametrize(
    ("pair", "confidence"), [((3.0, 1.06), 0.9), ((9.2, 5.9), 0.36), (None, 0.45)], ids=["all", "a third", "none"]
)
def test_what_places_tell_is_no_surer_than_all_presses_make_it(
    pair: tuple[float, float] | None, confidence: float
) -> None:
    claim = Claim(PiezoInhomogeneity(amplitude=0.1), 0.9, 2.0, {}, by_place=True)
    chosen = (SimpleNamespace(term=SimpleNamespace(name=claim.effect.name), by_place=pair),)
    judged = as_sure_as_all(claim, SimpleNamespace(chosen=chosen), DEFAULT)  # type: ignore[arg-type]
    assert judged.confidence == pytest.approx(confidence, abs=0.01)
    assert [reason.rule for reason in judged.reasons] == ([] if confidence == 0.9 else ["all_presses"])
    predicting = replace(claim, by_place=False)
    assert as_sure_as_all(predicting, SimpleNamespace(chosen=chosen), DEFAULT) is predicting  # type: ignore[arg-type]


@pytest.mark.parametrize("count", [4, 9])
def test_a_map_is_as_sure_as_the_places_that_tell_it(count: int) -> None:
    nodes = 0.5 * np.random.default_rng(0).standard_normal(node_shape(SENSOR.extent_m))
    effect = PiezoInhomogeneity(nodes=tuple(map(tuple, nodes.tolist())))
    field = field_map(effect, SENSOR)
    assert field is not None
    assert field.taxels is not None
    assert Claim(effect, 0.9, 2.0, {}, field_map=field).as_builtins()["confidence"] == 0.9
    pressed = np.arange(len(SENSOR.taxel_m))[::3][:count]
    places = Places(SENSOR.taxel_m[pressed], field.taxels.value[pressed], np.zeros(count))
    known = where_pressed(field, places, 0.1, lambda point_m: None)
    claim = Claim(effect, 0.9, 2.0, {}, field_map=known, by_place=True)
    written = claim.as_builtins()
    assert written["name_confidence"] == 0.9
    assert written["confidence_everywhere"] < 0.1
    assert written["confidence"] == pytest.approx(written["confidence_everywhere"] if count == 4 else 0.9)
    assert written["map"]["taxels"]["right"] == pytest.approx(written["confidence"] / 0.9, abs=1e-2)
    assert written["map"]["taxels"]["right_everywhere"] == pytest.approx(
        written["confidence_everywhere"] / 0.9, abs=1e-2
    )
    assert "right" not in written["map"]
    if count == 4:
        last = written["reasons"][-1]
        assert (last["rule"], last["before"], last["after"]) == ("map_known", 0.9, written["confidence"])
        assert how_sure(claim) == f"0.90, with its map {claim.right:.2f}"
    else:
        assert how_sure(claim) == f"0.90, with its map 0.90 ({claim.right_everywhere:.2f} over the whole sheet)"
