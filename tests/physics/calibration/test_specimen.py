"""The specimen fit: noise and hysteresis told apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ertskin.physics.calibration.specimen import SpecimenFit, fit_specimen

LARGEST = 6e4


def specimen(width: float, noise: float, seed: int) -> SpecimenFit:
    rng = np.random.default_rng(seed)
    sweep = np.concatenate([np.arange(0, 61), np.arange(59, -1, -1)]) * 1e3
    x = np.tile(sweep, 5) / LARGEST
    loading = np.tile(np.concatenate([np.ones(60), [0.0], -np.ones(60)]), 5)
    fall = 0.8
    law = 18000 * (1 - fall * (1 - (1 - x) ** 5))
    loop = 0.5 * width * 18000 * fall * 4 * x * (1 - x) * loading
    resistance = (law + loop) * (1 + noise * rng.standard_normal(x.size))
    return fit_specimen(x * LARGEST, resistance, np.arange(x.size) * 0.5, np.repeat(np.arange(5), sweep.size))


def test_no_hysteresis_is_reported_as_none():
    fits = [specimen(0.0, 0.003, seed) for seed in range(20)]
    scores = [abs(fit.hysteresis) / fit.hysteresis_standard_error for fit in fits]
    assert np.median(scores) < 3
    assert np.mean([fit.noise_fraction for fit in fits]) == pytest.approx(0.003, rel=0.03)


def test_hysteresis_width_is_recovered():
    fit = specimen(0.047, 0.003, 1)
    assert fit.hysteresis == pytest.approx(0.047, abs=5 * fit.hysteresis_standard_error + 5e-4)
    assert fit.noise_fraction == pytest.approx(0.003, rel=0.15)
    assert fit.residual_fraction > 3 * fit.noise_fraction


def test_law_covariance_is_calibrated():
    at = np.linspace(0, LARGEST, 13)
    truth = 18000 * (1 - 0.8 * (1 - (1 - at / LARGEST) ** 5))
    scores = []
    for seed in range(60):
        fit = specimen(0.0, 0.003, seed)
        basis = fit.law.basis(at)
        error = np.sqrt(np.einsum("pi,ij,pj->p", basis, fit.covariance, basis))
        scores.append((fit.law.sheet_resistance_ohm_sq(at) - truth) / error)
    assert np.std(scores) == pytest.approx(1.0, abs=0.2)


def test_recorded_specimens(shared_data: Path):
    from ertskin.hardware.recording import read_recording

    widths = {}
    for name in ("known_none", "rig_a_train", "known_piezo_hysteresis"):
        s = read_recording(shared_data / "recordings" / f"{name}.h5").specimen
        assert s is not None
        fit = fit_specimen(s.stress_pa, s.sheet_resistance_ohm_sq, s.time_s, s.cycle)
        widths[name] = fit.hysteresis
        assert fit.noise_fraction == pytest.approx(0.003, rel=0.3)
        assert fit.law.zero_ohm_sq == pytest.approx(18000, rel=0.005)
    assert abs(widths["known_none"]) < 0.001
    assert widths["rig_a_train"] == pytest.approx(0.045, abs=0.005)
    assert widths["known_piezo_hysteresis"] > 0.08
