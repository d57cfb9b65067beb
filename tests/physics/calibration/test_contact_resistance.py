"""Contact resistances from the unloaded scan: truth recovered, both methods agreeing, errors calibrated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ertskin.physics.calibration.contact_resistance import (
    ContactProblem,
    direct_search,
    gauss_newton,
    pattern_search,
    robust,
    robust_weights,
)
from ertskin.physics.calibration.rest_frames import rest_scan
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.protocol import Protocol

CONTACT = np.array([950.0, 200.0, 420.0, 610.0, 150.0, 880.0, 333.0, 500.0])
SHEET = 18150.0
NOISE = 5e-4


@pytest.fixture(scope="module")
def clean(sheet: SheetModel, protocol: Protocol) -> np.ndarray:
    return protocol.readings(sheet.solve(sheet.uniform(SHEET), CONTACT).pair_resistance_ohm)


def problem(sheet: SheetModel, protocol: Protocol, voltage: np.ndarray, **extra: object) -> ContactProblem:
    given = {"sheet_resistance_ohm_sq": 18000.0, "guess_ohm": 10.0, "fit_sheet": True} | extra
    return ContactProblem(sheet, protocol, voltage, **given)  # type: ignore[arg-type]


@pytest.mark.parametrize("guess", [5.0, 10.0, 400.0, 5000.0])
def test_gauss_newton_recovers_the_truth_from_far_away(
    guess: float, sheet: SheetModel, protocol: Protocol, clean: np.ndarray
):
    fit = gauss_newton(problem(sheet, protocol, clean, guess_ohm=guess, noise_v=1e-6))
    assert fit.contact_resistance_ohm == pytest.approx(CONTACT, rel=1e-4)
    assert fit.sheet_resistance_ohm_sq == pytest.approx(SHEET, rel=1e-6)
    assert fit.evaluations <= 20


def test_known_sheet_resistance_stays(sheet: SheetModel, protocol: Protocol, clean: np.ndarray):
    fit = gauss_newton(problem(sheet, protocol, clean, fit_sheet=False, sheet_resistance_ohm_sq=SHEET))
    assert fit.sheet_resistance_ohm_sq == SHEET
    assert fit.contact_resistance_ohm == pytest.approx(CONTACT, rel=1e-4)


def test_direct_search_agrees_and_takes_far_longer(sheet: SheetModel, protocol: Protocol, clean: np.ndarray):
    noisy = clean + NOISE * np.random.default_rng(0).standard_normal(clean.shape)
    posed = problem(sheet, protocol, noisy, noise_v=NOISE)
    newton, search = gauss_newton(posed), direct_search(posed)
    apart = np.abs(search.contact_resistance_ohm - newton.contact_resistance_ohm)
    assert np.all(apart < 0.2 * newton.standard_error_ohm)
    assert search.rms_after_v == pytest.approx(newton.rms_after_v, rel=1e-4)
    assert search.rms_before_v == pytest.approx(newton.rms_before_v, rel=1e-9)
    assert newton.rms_after_v < 0.1 * newton.rms_before_v
    assert search.evaluations > 50 * newton.evaluations


def test_standard_errors_are_calibrated(sheet: SheetModel, protocol: Protocol, clean: np.ndarray):
    scores, chi = [], []
    for seed in range(25):
        noisy = clean + NOISE * np.random.default_rng(seed).standard_normal(clean.shape)
        fit = gauss_newton(problem(sheet, protocol, noisy, guess_ohm=300.0))
        scores.append((fit.contact_resistance_ohm - CONTACT) / fit.standard_error_ohm)
        scores.append([(fit.sheet_resistance_ohm_sq - SHEET) / fit.sheet_standard_error_ohm_sq])
        chi.append(fit.residual_rms_v / NOISE)
    flat = np.concatenate(scores)
    assert flat.std() == pytest.approx(1.0, abs=0.2)
    assert np.mean(chi) == pytest.approx(1.0, abs=0.08)


def test_a_wrong_electrode_is_weighted_out(sheet: SheetModel, protocol: Protocol, clean: np.ndarray):
    wrong = clean + NOISE * np.random.default_rng(3).standard_normal(clean.shape)
    pairs = protocol.pairs
    assert pairs is not None
    reads_only = ~(pairs == 5).any(axis=1)
    wrong[reads_only, 5] += 0.05
    posed = problem(sheet, protocol, wrong, guess_ohm=300.0)
    least_squares, bent = gauss_newton(posed), robust(posed)
    others = np.arange(8) != 5
    assert np.abs(bent.contact_resistance_ohm - CONTACT)[others].max() < 3.0
    assert np.abs(least_squares.contact_resistance_ohm - CONTACT)[others].max() > 10.0
    weight = robust_weights(posed, bent)
    assert weight[reads_only, 5].max() < 0.01
    assert np.median(weight) > 0.8


def test_a_contact_that_wants_to_vanish_stays_positive(sheet: SheetModel, protocol: Protocol):
    tiny = CONTACT.copy()
    tiny[2] = 1e-3
    voltage = protocol.readings(sheet.solve(sheet.uniform(SHEET), tiny).pair_resistance_ohm)
    voltage = voltage + NOISE * np.random.default_rng(1).standard_normal(voltage.shape)
    fit = gauss_newton(problem(sheet, protocol, voltage))
    assert fit.contact_resistance_ohm[2] > 0
    assert fit.contact_resistance_ohm[2] < 5 * fit.standard_error_ohm[2]


def test_a_fit_that_misses_by_far_more_than_the_noise_still_ends(sheet: SheetModel):
    """An uneven sheet, driven electrodes not read: contacts bend far."""
    adjacent = np.stack([np.arange(8), (np.arange(8) + 1) % 8], axis=1)
    current = np.zeros((8, 8))
    current[np.arange(8), adjacent[:, 0]], current[np.arange(8), adjacent[:, 1]] = 5e-4, -5e-4
    apart = np.abs((np.arange(8)[:, None] - np.arange(8) + 4) % 8 - 4) > 1
    protocol, even = Protocol.differences(current, adjacent, measured=apart), sheet.uniform(18000.0)
    for seed in range(20, 30):
        rng = np.random.default_rng(seed)
        wave = np.sin(np.linspace(0, rng.uniform(2, 9), len(even)) + rng.uniform(0, 6))
        solved = sheet.solve(even * np.exp(0.3 * wave)[:, None], np.full(8, 300.0))
        fit = gauss_newton(problem(sheet, protocol, protocol.readings(solved.pair_resistance_ohm), noise_v=NOISE))
        assert fit.evaluations < 30
        assert fit.noise_v == pytest.approx(fit.residual_rms_v)
        assert fit.residual_rms_v > 5 * NOISE
        assert fit.rms_after_v < fit.rms_before_v


def test_pattern_search_finds_rosenbrocks_minimum():
    found = pattern_search(
        lambda x: float(100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2), np.array([-1.2, 1.0]), 0.5, 1e-9
    )
    assert found == pytest.approx([1.0, 1.0], abs=1e-3)


def test_recorded_rest_fits_to_its_noise_and_both_methods_agree(shared_data: Path):
    """Nothing was left out of this recording: its resting mean fits to the noise of a mean of 19 frames."""
    from ertskin.hardware.recording import read_recording

    r = read_recording(shared_data / "recordings" / "known_none.h5")
    assert r.sensor is not None
    assert r.frames is not None
    assert r.protocol is not None
    scan = rest_scan(r.frames.voltage_v[r.frames.history.phase == 0], r.protocol)
    assert scan.noise_v == pytest.approx(2e-3, rel=0.02)
    noise = scan.noise_v / np.sqrt(scan.frames)
    posed = ContactProblem(SheetModel(r.sensor, "fast"), r.protocol, scan.voltage_v, 18000.0, 10.0, True, noise)
    newton = gauss_newton(posed)
    assert newton.residual_rms_v / noise == pytest.approx(1.0, abs=0.12)
    assert newton.sheet_resistance_ohm_sq == pytest.approx(18000, rel=3e-4)
    # the paper's own problem: the sheet resistance is known
    known = replace(posed, fit_sheet=False)
    apart = direct_search(known, stride=1e-4).contact_resistance_ohm - gauss_newton(known).contact_resistance_ohm
    assert np.abs(apart).max() < 0.3


def test_water_tank(shared_data: Path):
    """One contact resistance per electrode and the water's; electrode 30 reads wrong and is weighted out."""
    from ertskin.hardware.recording import read_recording

    r = read_recording(shared_data / "real" / "ktc2023_tank_a.h5")
    assert r.sensor is not None
    assert r.frames is not None
    assert r.protocol is not None
    voltage = np.asarray(r.frames.voltage_v[0], dtype=float)
    posed = ContactProblem(SheetModel(r.sensor, "fast"), r.protocol, voltage, 1000.0, 10.0, True)
    fit = robust(posed, rounds=2)
    assert fit.sheet_resistance_ohm_sq == pytest.approx(1215, rel=0.03)
    assert np.all(fit.contact_resistance_ohm > 0)
    weight = robust_weights(posed, fit).mean(axis=0)
    assert set(np.argsort(weight)[:2]) == {29, 30}
    assert weight[[29, 30]].max() < 0.5 * np.median(weight)


def test_noise_given_sets_the_errors(sheet: SheetModel, protocol: Protocol, clean: np.ndarray):
    posed = problem(sheet, protocol, clean, guess_ohm=300.0, noise_v=NOISE)
    doubled = replace(posed, noise_v=2 * NOISE)
    assert gauss_newton(doubled).standard_error_ohm == pytest.approx(
        2 * gauss_newton(posed).standard_error_ohm, rel=1e-3
    )
