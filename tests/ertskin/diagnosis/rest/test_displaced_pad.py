"""A pad far from its place, which its contact resistance would hide."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.rest.displaced_pad import displaced_pad
from ertskin.diagnosis.rest.rest_frames import fitted_at_rest
from ertskin.hardware.virtual.bench.nominal import nominal_protocol, nominal_sensor
from ertskin.physics.effects.electrode_displacement import ElectrodeDisplacement
from ertskin.physics.piezo.polynomial import PiezoPolynomial
from ertskin.physics.sensor import Sensor
from ertskin.physics.skin import Skin

NOISE_V = 7e-4
LAW = PiezoPolynomial(np.array([0.6, -0.4]), 6e4, 18e3)


def skin_of(sensor: Sensor, seed: int = 0) -> Skin:
    """The skin, its first contact a good one."""
    contacts = np.random.default_rng(seed).uniform(200.0, 1000.0, sensor.electrodes)
    contacts[0] = 250.0
    return Skin.build(sensor, nominal_protocol(sensor), LAW, contacts, np.inf, (), "fine")


def at_rest(sensor: Sensor) -> tuple[Skin, np.ndarray, float, float]:
    """The nominal skin calibrated to a resting scan of one with this geometry, the scan, its noise and the misfit."""
    real = skin_of(sensor)
    solution = real.sheet.solve(real.sheet.uniform(18e3), real.contact_resistance_ohm)
    scan_v = real.protocol.whitened(solution.pair_resistance_ohm)
    scan_v = scan_v + NOISE_V * np.random.default_rng(1).standard_normal(len(scan_v))
    skin, _, fitted_v = fitted_at_rest(skin_of(nominal_sensor(), seed=2), scan_v)
    return skin, scan_v, NOISE_V, float(np.sqrt(np.mean((scan_v - fitted_v) ** 2)) / NOISE_V)


def test_it_is_found_where_it_lies() -> None:
    skin, *rest = at_rest(ElectrodeDisplacement(0, 2.6e-3, 1.4e-3).geometry(nominal_sensor()))
    assert skin.contact_resistance_ohm[0] < 5.0
    found = displaced_pad(skin, *rest, DEFAULT)
    assert found is not None
    assert found.electrode == 0
    # The prior on its contact resistance pulls a little.
    assert (found.dx_m, found.dy_m) == pytest.approx((2.6e-3, 1.4e-3), abs=1e-4)


def test_none_is_made_up() -> None:
    assert displaced_pad(*at_rest(nominal_sensor()), DEFAULT) is None


@pytest.mark.parametrize("contact_ohm", [1e-3, 250.0])
def test_a_scan_that_no_place_explains_moves_none(contact_ohm: float) -> None:
    skin, scan_v, noise_v, _ = at_rest(nominal_sensor())
    skin.contact_resistance_ohm[0] = contact_ohm
    other = np.random.default_rng(3).permutation(scan_v)
    assert displaced_pad(skin, other, noise_v, 1e3, DEFAULT) is None
