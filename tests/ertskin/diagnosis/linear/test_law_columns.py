"""Derivatives by the sheet's resistance and its law, in closed form, against differences of the linearised skin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_skin import SMALL, small_law, small_sensor, two_presses, undriven

from ertskin.diagnosis.linear.calibration_vector import SHAPE, Calibration, SkinFamily
from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.physics.effects.contact_pressure_dependence import ContactPressureDependence
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.scan_skew import ScanSkew
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity
from ertskin.physics.effects.temperature_drift import TemperatureDrift
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

PAIRS = electrode_pairs(6)
SCAN = Protocol.against_sink(PAIRS, 6, 1e-4, injection_offset_s=np.linspace(0.0, 0.4, len(PAIRS)))
STEP = 1e-4
CASES: dict[str, tuple[Effect, ...]] = {
    "nothing": (),
    "plays, a field and a drift": (
        PiezoHysteresis(width=0.1),
        SheetInhomogeneity(amplitude=0.2, x_m=0.02, y_m=0.02, radius_m=0.01),
        TemperatureDrift(0.02),
    ),
    "creep that stays": (PiezoCreep(fraction=0.2, time_s=20.0, remembers_air=True),),
    "creep that multiplies": (PiezoCreep(fraction=0.2, time_s=20.0, remembers_air=True, multiplies=True),),
    "a field in the response, under what stays": (
        PiezoInhomogeneity(amplitude=0.5, x_m=0.02, y_m=0.02, radius_m=0.01, in_response=0.7),
        PiezoCreep(fraction=0.2, time_s=20.0, remembers_air=True, multiplies=True),
    ),
    "a moving press on contacts that feel it": (ScanSkew(speed_m_per_s=1e-3), ContactPressureDependence(1e-5)),
}


@pytest.mark.parametrize("effects", CASES.values(), ids=CASES.keys())
def test_derivatives_by_the_law_are_the_differences_it_makes(effects: tuple[Effect, ...]) -> None:
    holds(effects, SCAN)


def test_they_are_where_driven_electrodes_are_not_read() -> None:
    holds((ContactPressureDependence(1e-5), TemperatureDrift(0.2)), undriven())


def holds(effects: tuple[Effect, ...], protocol: Protocol) -> None:
    """Far from where the skin is linearised: about a sheet of less resistance, other contacts, another law."""
    history = two_presses()
    skin = Skin.build(small_sensor(), protocol, small_law(), np.linspace(200.0, 900.0, 6), 9000.0, (), SMALL)
    family = SkinFamily(skin, "fast")
    linear = LinearSkin(replace(skin, effects=effects[:1]), history, np.nan_to_num(skin.force_n(history)))
    contacts = skin.contact_resistance_ohm * np.exp(np.linspace(1.0, -1.0, 6))
    begun = Calibration(1.4 * skin.piezo.zero_ohm_sq, contacts, 0.0, 0.02 * np.cos(np.arange(SHAPE)))
    found = linear.law_columns(family.skin(begun, effects), SHAPE)
    vector = begun.vector()
    for column, k in enumerate([0, *range(len(vector) - SHAPE, len(vector))]):
        moved = vector.copy()
        sides = []
        for side in (STEP, -STEP):
            moved[k] = vector[k] + side
            sides.append(linear.scans(family.skin(Calibration.of(moved), effects)))
        difference = (sides[0] - sides[1]) / (2 * STEP)
        assert np.abs(difference).max() > 0
        near = 2e-3 if k else 1e-6  # the law's are in single precision
        np.testing.assert_allclose(found[..., column], difference, atol=near * np.abs(difference).max())
