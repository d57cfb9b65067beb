"""What is checked of every scan while a recording runs: saturation, reciprocity, noise."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.hardware.instrument import Scan
from ertskin.hardware.live_checks import LiveChecks
from ertskin.physics.protocol import Protocol, electrode_pairs

PROTOCOL = Protocol.against_sink(electrode_pairs(8), 8, 1e-4, adc_limit_v=10.0)
REST_V = PROTOCOL.readings(np.linspace(50.0, 150.0, 28))
NOISE_V = 1e-4


def scan(voltage_v: np.ndarray, **options: object) -> Scan:
    """A scan of these readings."""
    return Scan(0.0, voltage_v.astype(np.float32), **options)  # type: ignore[arg-type]


def test_a_sound_skin_gives_no_warning_and_its_noise() -> None:
    checks, rng = LiveChecks(PROTOCOL), np.random.default_rng(0)
    rms = float(np.sqrt(np.mean(REST_V**2)))
    assert rms > 20 * NOISE_V
    for number in range(60):
        # Presses change readings far beyond the noise: what a network of resistors explains is no noise.
        soundness = checks.look(scan((1.0 + 0.2 * (number % 3)) * REST_V + NOISE_V * rng.normal(size=REST_V.shape)))
    assert soundness.noise_v == pytest.approx(NOISE_V, rel=0.1)
    assert soundness.saturated == 0.0


def test_readings_no_network_gives_are_reported() -> None:
    checks = LiveChecks(PROTOCOL)
    assert checks.look(scan(REST_V)).warnings() == []
    swapped = REST_V.copy()
    swapped[0] += 0.5 * np.abs(REST_V).max()
    assert any("reciprocity defect" in text for text in checks.look(scan(swapped)).warnings())


def test_saturation_is_reported_by_limit_or_by_the_device() -> None:
    checks = LiveChecks(PROTOCOL)
    high = REST_V.copy()
    high[0, 0] = 10.0
    marked = np.zeros(REST_V.shape, dtype=bool)
    marked[:2] = True
    assert checks.look(scan(high)).saturated == pytest.approx(1 / REST_V.size)
    assert checks.look(scan(REST_V, saturated=marked)).saturated == pytest.approx(2 / 28)
    assert any("saturated" in text for text in checks.look(scan(high)).warnings())
