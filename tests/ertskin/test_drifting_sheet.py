"""What a temperature does to a sheet: drifts, swings, gradients and loads that are warm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_skin import SMALL, small_law, small_sensor, two_presses

from ertskin.physics.conduction.drifting import DriftedSheets
from ertskin.physics.effects.piezo_chain import felt
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.temperature_drift import TemperatureDrift
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

CONTACTS_OHM = np.linspace(200.0, 900.0, 6)


@pytest.fixture(scope="module")
def skin() -> Skin:
    scan = Protocol.against_sink(electrode_pairs(6), 6, 1e-4)
    return Skin.build(small_sensor(), scan, small_law(), CONTACTS_OHM, 9000.0, (), SMALL)


@pytest.mark.parametrize(("rate_per_h", "shared"), [(-0.8, True), (0.7, True), (1.5, True), (4.9, False)])
def test_a_drifting_sheet_is_the_sheet_solved_anew(skin: Skin, rate_per_h: float, shared: bool) -> None:
    history, drift = two_presses(), TemperatureDrift(rate_per_h=rate_per_h)
    seen = replace(skin, effects=(drift,)).pair_resistance_ohm(history)
    assert (DriftedSheets.of(skin._resting, np.log(drift.drift(history.time_s))) is not None) is shared
    for row, factor in enumerate(drift.drift(history.time_s)):
        contacts = skin.contact_resistance_ohm / factor
        other = replace(skin, contact_resistance_ohm=contacts)
        expected = factor * other.pair_resistance_ohm(history, wanted=np.array([row]))[0]
        np.testing.assert_allclose(seen[row], expected, rtol=1e-6)


def test_it_is_warmer_on_one_side_by_the_gradient() -> None:
    drift = TemperatureDrift(rate_per_h=-0.4, gradient_x=0.5)
    sensor = small_sensor()
    scan = Protocol.against_sink(electrode_pairs(6), 6, 1e-4)
    place_m = np.array([[0.0, 0.03], [0.03, 0.03], [0.06, 0.03]])
    found = drift.warmth(place_m, np.array([0.0, 1800.0]), sensor, scan)
    assert found is not None
    middle = -np.log(drift.drift(np.array([1800.0])))
    np.testing.assert_allclose(np.outer(found[1], found[0])[1], middle * [-0.5, 0.0, 0.5], atol=1e-12)


def test_a_swing_comes_back_after_its_period() -> None:
    swing = TemperatureDrift(swing_sine=0.01, swing_cosine=-0.02, period_h=0.25)
    drift = np.log(swing.drift(np.array([0.0, 225.0, 450.0, 900.0])))
    np.testing.assert_allclose(drift, [0.0, 0.01 + 0.02, 0.04, 0.0], atol=1e-12)


def test_a_warm_load_warms_where_it_presses_and_leaves_that_behind(skin: Skin) -> None:
    warm = TemperatureDrift(load_rise=-0.1, load_lasts_s=8.0)
    part = warm.in_fabric()
    assert part is not None
    time_s = np.array([0.0, 0.001, 8.0, 8.001, 16.0])
    pressure = np.array([0.0, 2e4, 2e4, 0.0, 0.0])[:, None]
    gained = -np.log(np.asarray(part.resistance_factor(pressure, np.zeros((1, 2)), time_s, np.zeros((2, 2))))[:, 0])
    np.testing.assert_allclose(gained, 0.1 * np.array([0.0, 0.0, 0.632, 0.632, 0.2325]), atol=2e-4)
    assert TemperatureDrift(rate_per_h=1.0).in_fabric() is None


def test_a_load_is_warm_where_it_touches_though_the_fabric_still_creeps(skin: Skin) -> None:
    warm, creep = TemperatureDrift(load_rise=-0.05, load_lasts_s=10.0), PiezoCreep(0.1, 30.0, remembers_air=True)
    time_s = np.arange(0.0, 120.0, 1.0)
    pressure = np.where(time_s < 40.0, 5e4, 0.0)[:, None]
    asked = pressure, np.zeros((1, 2)), time_s, np.zeros((2, 2))
    without, both = felt((creep,), *asked), felt((creep, warm), *asked)
    np.testing.assert_array_equal(both[0], without[0])
    assert np.log(both[1])[60, 0] == pytest.approx(-0.05 * np.exp(-2.0), rel=0.15)
    assert np.log(both[1])[110, 0] == pytest.approx(0.0, abs=1e-4)
