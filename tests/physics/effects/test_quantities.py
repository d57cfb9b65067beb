"""Quantities that mean the same in any form, against what each form gives in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ertskin.physics.effects.adc_saturation import AdcSaturation
from ertskin.physics.effects.channel_gain import ChannelGain
from ertskin.physics.effects.contact_pressure_dependence import ContactPressureDependence
from ertskin.physics.effects.foam_hysteresis import FoamHysteresis
from ertskin.physics.effects.foam_softening import FoamSoftening
from ertskin.physics.effects.nonlinear_foam import NonlinearFoam
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.registry import effect_classes
from ertskin.physics.effects.scan_skew import ScanSkew
from ertskin.physics.effects.self_heating import SelfHeating
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity
from ertskin.physics.effects.standard import Standard
from ertskin.physics.effects.temperature_drift import TemperatureDrift
from ertskin.physics.effects.viscoelastic_foam import ViscoelasticFoam

LARGEST_PA = 1e5
POINT_M = np.stack(np.meshgrid(np.linspace(0, 0.1, 41), np.linspace(0, 0.2, 41)), axis=-1).reshape(-1, 2)
EXTENT_M = np.array([[0.0, 0.0], [0.1, 0.2]])


def standard(law=lambda pressure_pa: np.exp(-pressure_pa / LARGEST_PA)) -> Standard:
    return Standard(law, LARGEST_PA, 2e-3, 1e-2, 2e-4, 0.5, POINT_M, EXTENT_M)


@pytest.mark.parametrize("kind", effect_classes().values(), ids=lambda k: k.name)
def test_a_neutral_effect_has_quantities_of_nothing(kind: type) -> None:
    for name, value in kind().quantities(standard()).items():
        assert value == pytest.approx(1.0 if name == "conductance_ratio" else 0.0, abs=1e-9), name


def test_a_loop_on_a_straight_law_is_as_wide_as_its_play() -> None:
    # Up x = p (1 - w), down x = min(top, p (1 + w)): the gap is widest where the branch down leaves the top.
    width = 0.1
    said = PiezoHysteresis(width=width).quantities(standard(lambda p: 2.0 - p / LARGEST_PA))["loop_width"]
    assert said == pytest.approx(1 - (1 - width) / (1 + width), rel=0.02)


def test_creep_of_one_time_constant_grows_as_the_exponential_says() -> None:
    # On a law whose logarithm is straight, conductance gained is the pressure felt.
    creep = PiezoCreep(fraction=0.3, time_s=4.0)
    after_rise = 1 - (1 - np.exp(-2 / 4.0)) * 4.0 / 2
    after_hold = 1 - (1 - after_rise) * np.exp(-10 / 4.0)
    assert creep.quantities(standard())["share_crept"] == pytest.approx(0.3 * (after_hold - after_rise), rel=0.03)


def test_creep_that_multiplies_is_measured_by_the_same_quantity() -> None:
    added = PiezoCreep(fraction=0.1, time_s=1.0, decades=2.0, remembers_air=True).quantities(standard())["share_crept"]
    multiplied = PiezoCreep(
        fraction=0.1, time_s=1.0, decades=2.0, remembers_air=True, multiplies=True, half_pa=1e6, unevenness=0.0
    ).quantities(standard())["share_crept"]
    # Far below half_pa the gaps that close are ln 2 p / half_pa, where the other takes p over the law's 1e5 Pa.
    assert multiplied == pytest.approx(added * np.log(2) / 10, rel=0.05)


@pytest.mark.parametrize("form", [{}, {"multiplies": True, "half_pa": 1e6}], ids=["adds", "multiplies"])
def test_a_decade_of_creep_that_no_reading_tells_may_have_passed_for_the_law(form: dict[str, Any]) -> None:
    """What creeps with time constants of 0.2 s to 2 s has crept once a rise is over."""
    creep = PiezoCreep(fraction=0.6, time_s=2.0, decades=2.0, remembers_air=True, **form)
    known, unseen = (said["share_crept"] for said in (creep.quantities(standard()), creep.unseen(standard())))
    law = standard().resistance(np.array([0.0, LARGEST_PA / 2]))
    static = float(np.log(law[0] / law[1]))
    passed = 0.3 * (1 - 2 ** (-LARGEST_PA / 2 / 1e6)) if form else static * 0.3 / 1.3
    assert unseen == pytest.approx(known * static / (static - passed), rel=1e-3)


@pytest.mark.parametrize("creep", [PiezoCreep(0.3, 4.0), PiezoCreep(0.3, 20.0, decades=2.0)], ids=["one", "slow"])
def test_what_readings_tell_has_not_passed_for_the_law(creep: PiezoCreep) -> None:
    assert creep.unseen(standard()) == {}


def test_a_slope_and_its_map() -> None:
    slope = PiezoInhomogeneity(gradient_x=0.6)
    assert slope.quantities(standard())["log_spread"] == pytest.approx(0.6 / np.sqrt(12), rel=0.03)
    assert slope.map_at(np.array([[0.0, 0.1], [0.1, 0.1]]), EXTENT_M) == pytest.approx([-0.3, 0.3])
    resistance = SheetInhomogeneity(gradient_y=0.4)
    assert resistance.map_at(np.array([[0.05, 0.2]]), EXTENT_M) == pytest.approx([0.2])


def test_foam() -> None:
    assert NonlinearFoam(stiffening=5.0, exponent=2.0).quantities(standard())["stiffening_at_deepest"] == pytest.approx(
        5 * 0.2**2
    )
    relaxed = ViscoelasticFoam(fraction=0.5, time_s=10.0).quantities(standard())["share_relaxed"]
    assert relaxed == pytest.approx(1 - (1 + 0.5 * np.exp(-1)) / 1.5)
    # Up with 1 + loss, down with 1 - loss, turned round at once.
    lost = FoamHysteresis(loss=0.1, reversal=0.005).quantities(standard())["loss_share"]
    assert lost == pytest.approx(2 * 0.1 / 1.1, rel=0.03)


def test_sheet_electrodes_and_instrument() -> None:
    assert SheetAnisotropy(stretch_x=0.3, stretch_diagonal=0.4).quantities(standard()) == {
        "conductance_ratio": pytest.approx(np.exp(0.5))
    }
    assert TemperatureDrift(rate_per_h=0.12).quantities(standard())["log_change_300_s"] == pytest.approx(
        -0.01, rel=1e-3
    )
    pressed = ContactPressureDependence(sensitivity_per_pa=1e-4, bend=1.0).quantities(standard())
    assert pressed["gain_at_half_span"] == pytest.approx(5.0)
    assert ChannelGain(gain=0.02).quantities(standard()) == {"gain_less_one": 0.02}
    assert AdcSaturation(compression=0.5, sharpness=2.0, level_v=3.0).quantities(standard()) == {
        "limit_v": pytest.approx(3.0 / np.sqrt(3.0))
    }
    assert ScanSkew(speed_m_per_s=1e-4).quantities(standard())["share_of_step_in_scan"] == pytest.approx(0.25)


def test_foam_softens_by_what_fades_of_its_excess_over_two_presses() -> None:
    said = FoamSoftening(excess=0.2, kept=0.5, presses=2.0).quantities(standard())
    assert said["softened_third_press"] == pytest.approx(1 - (1 + 0.2 * np.exp(-2 / 2.0)) / 1.2)


def test_a_sheet_warms_as_its_time_constant_says() -> None:
    said = SelfHeating(crowded_rise=-0.01, lasts_s=100.0).quantities(standard())
    assert said["warmed_300_s"] == pytest.approx(-0.01 * (1 - np.exp(-3)))
    # What is gone before the next scan has no such quantity.
    assert SelfHeating(rise=0.01).quantities(standard()) == {}
