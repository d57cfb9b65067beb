"""A pad far from its place, which its contact resistance would hide."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ertskin.diagnosis.displaced_pad import displaced_pad
from ertskin.diagnosis.resting import _calibrated
from hardware.virtual.bench.nominal import nominal_protocol, nominal_sensor
from physics.effects.electrode_displacement import ElectrodeDisplacement
from physics.piezo.polynomial import PiezoPolynomial
from physics.skin import Skin

NOISE_V = 2e-3
RESTS = 9


def at_rest(effect: ElectrodeDisplacement | None) -> tuple[Skin, Any, float]:
    """The skin as calibrated, the evidence of its rest frames and the misfit."""
    sensor = nominal_sensor()
    contacts = np.random.default_rng(0).uniform(200.0, 1000.0, sensor.electrodes)
    contacts[0] = 250.0
    law = PiezoPolynomial(np.array([0.6, -0.4]), 6e4, 18e3)
    nominal = Skin.build(sensor, nominal_protocol(sensor), law, contacts, np.inf, (), "fine")
    real = nominal
    if effect is not None:
        real = Skin.build(effect.geometry(sensor), nominal.protocol, law, contacts, np.inf, (), "fine")
    scan = nominal.protocol.whitened(real.sheet.solve(real.sheet.uniform(18e3), contacts).pair_resistance_ohm)
    noise = np.random.default_rng(1).standard_normal((RESTS, len(scan)))
    evidence = SimpleNamespace(
        sensor=sensor, rest=np.ones(RESTS, dtype=bool), scan_v=scan + NOISE_V * noise, noise_v=NOISE_V
    )
    mean = evidence.scan_v.mean(axis=0)
    skin, _, fitted = _calibrated(nominal, mean)
    return skin, evidence, float(np.sqrt(np.mean((mean - fitted) ** 2) * RESTS) / NOISE_V)


def test_it_is_found_where_it_lies() -> None:
    skin, evidence, misfit = at_rest(ElectrodeDisplacement(0, 2.6e-3, 1.4e-3))
    assert skin.contact_resistance_ohm[0] < 5.0
    found = displaced_pad(skin, evidence, misfit)
    assert found is not None
    assert found.electrode == 0
    # The prior on its contact resistance pulls a little.
    assert (found.dx_m, found.dy_m) == pytest.approx((2.6e-3, 1.4e-3), abs=1e-4)


def test_none_is_made_up() -> None:
    assert displaced_pad(*at_rest(None)) is None
