"""Simulate, write, read, calibrate, diagnose, with nothing but what ``import ertskin`` offers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_skin import small_law, small_sensor

import ertskin

CONTACT_OHM = np.array([8.0, 12.0, 9.0, 15.0, 11.0, 10.0])


@pytest.fixture(scope="module")
def calibration() -> ertskin.Calibration:
    """A small skin whose numbers are known."""
    return ertskin.Calibration("small skin", small_sensor(), small_law(), CONTACT_OHM, noise_v=1e-5)


@pytest.fixture(scope="module")
def protocol() -> ertskin.Protocol:
    return ertskin.protocol_of({"injection": "all", "measurement": "sink", "current_a": 1e-4}, electrodes=6)


@pytest.fixture(scope="module")
def history(calibration: ertskin.Calibration) -> ertskin.History:
    return ertskin.History.of_presses(calibration.known_sensor.taxel_m[:2], [2.0, 5.0], frames=2, step_s=0.5)


def test_a_history_of_presses(history: ertskin.History) -> None:
    phases = [ertskin.Phase.REST, ertskin.Phase.HOLD, ertskin.Phase.HOLD]
    assert history.phase.tolist() == [*phases, *phases, ertskin.Phase.REST]
    assert history.press.tolist() == [0, 0, 0, 1, 1, 1, 2]
    assert history.time_s.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]
    np.testing.assert_array_equal(history.force_n[:, 0], [np.nan, 2.0, 2.0, np.nan, 5.0, 5.0, np.nan])
    assert history.touched[:, 0].tolist() == [False, True, True, False, True, True, False]
    two = ertskin.History.of_presses(np.full((3, 2, 2), 0.01), np.ones((3, 2)))
    assert two.contact_m.shape == (7, 2, 2)


def test_simulated_is_read_back_and_calibrated(
    calibration: ertskin.Calibration, protocol: ertskin.Protocol, history: ertskin.History, tmp_path: Path
) -> None:
    frames = ertskin.simulate(calibration, protocol, history, noise_v=1e-5, seed=3)
    assert frames.voltage_v.shape == (7, 15, 6)
    assert np.ptp(frames.voltage_v[[0, 3, 6]], axis=0).max() < 1e-4  # at rest: noise alone
    assert np.abs(frames.voltage_v[1] - frames.voltage_v[0]).max() > 1e-2
    path = tmp_path / "small.h5"
    stated = replace(calibration.known_sensor, sheet_resistance_ohm_sq=15e3)
    ertskin.write_recording(
        path, ertskin.Recording("simulated", "2026-01-01T00:00:00Z", sensor=stated, protocol=protocol, frames=frames)
    )
    found = ertskin.calibrate(path)
    np.testing.assert_allclose(found.contact_resistance_ohm, CONTACT_OHM, atol=1.0)
    assert found.known_sensor.sheet_resistance_ohm_sq == pytest.approx(small_law().zero_ohm_sq, rel=1e-3)
    assert found.recording == "small.h5"
    ertskin.save_calibration(tmp_path / "calibration.yaml", found)
    again = ertskin.load_calibration(tmp_path / "calibration.yaml")
    np.testing.assert_array_equal(again.contact_resistance_ohm, found.contact_resistance_ohm)


def test_the_same_seed_gives_the_same_frames(
    calibration: ertskin.Calibration, protocol: ertskin.Protocol, history: ertskin.History
) -> None:
    one, same, other = (
        ertskin.simulate(calibration, protocol, history, noise_v=1e-3, seed=seed).voltage_v for seed in (0, 0, 1)
    )
    np.testing.assert_array_equal(one, same)
    assert np.std(one - other) == pytest.approx(np.sqrt(2) * 1e-3, rel=0.1)


def test_effects_as_settings_and_as_a_diagnosis_gives_them(
    calibration: ertskin.Calibration, protocol: ertskin.Protocol, history: ertskin.History
) -> None:
    from ertskin.physics.effects.registry import build_effects

    settings = {"piezo_creep": {"fraction": 0.5, "time_s": 1.0}}
    without, crept = (ertskin.simulate(calibration, protocol, history, e).voltage_v for e in ({}, settings))
    assert np.abs(crept[2] - without[2]).max() > 1e-3
    np.testing.assert_array_equal(
        crept, ertskin.simulate(calibration, protocol, history, build_effects(settings)).voltage_v
    )
    with pytest.raises(ertskin.UserError, match="no effect named 'creep'"):
        ertskin.simulate(calibration, protocol, history, {"creep": {}})


def test_what_can_not_be_done_is_said_in_one_line(
    protocol: ertskin.Protocol, history: ertskin.History, tmp_path: Path
) -> None:
    bare = ertskin.Calibration("mine.h5", small_sensor())
    with pytest.raises(ertskin.UserError, match="its calibration has no piezoresistive law"):
        ertskin.simulate(bare, protocol, history)
    with pytest.raises(ertskin.RecordingError, match="found no such file"):
        ertskin.calibrate(tmp_path / "missing.h5")
    with pytest.raises(ertskin.UserError, match="nothing to calibrate on"):
        ertskin.calibrate(ertskin.Recording("empty", ""))


def test_a_resting_skin_is_diagnosed(calibration: ertskin.Calibration, protocol: ertskin.Protocol) -> None:
    rest = ertskin.History.of_presses(np.full((5, 2), np.nan), np.full(5, np.nan))
    frames = ertskin.simulate(calibration, protocol, rest, noise_v=1e-4)
    recording = ertskin.Recording("still", "", sensor=calibration.sensor, protocol=protocol, frames=frames)
    answer = ertskin.diagnose(recording)
    assert answer.verdict in ("no_mismatch", "cannot_tell")
    assert answer.effects == ()
    assert answer.as_builtins()["format"] == "ertskin-diagnosis"
