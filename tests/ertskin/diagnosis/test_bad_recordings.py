"""What can't be diagnosed gets a verdict with its reason, never a traceback and never a name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ertskin.diagnosis.any_recording import diagnose_any
from ertskin.diagnosis.contract.claims import Diagnosis
from ertskin.hardware.recording import Recording, RigidBlock, read_recording
from ertskin.hardware.virtual.bench import FAST, write_bench


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    path = tmp_path_factory.mktemp("bad") / "good.h5"
    write_bench(path, "quick", {}, seed=8, resolution=FAST)
    return read_recording(path)


def some_frames(recording: Recording, rows: np.ndarray) -> Recording:
    frames = recording.frames
    assert frames is not None
    counts = None if frames.adc_count is None else frames.adc_count[rows]
    chosen = replace(frames, voltage_v=frames.voltage_v[rows], history=frames.history[rows], adc_count=counts)
    return replace(recording, frames=chosen)


def with_history(recording: Recording, **changed: np.ndarray) -> Recording:
    assert recording.frames is not None
    history = replace(recording.frames.history, **changed)  # type: ignore[arg-type]
    return replace(recording, frames=replace(recording.frames, history=history))


def reading(recording: Recording, voltage_v: np.ndarray) -> Recording:
    assert recording.frames is not None
    return replace(recording, frames=replace(recording.frames, voltage_v=voltage_v, adc_count=None))


def verdict(recording: Recording) -> Diagnosis:
    return diagnose_any(recording, "bad", lambda share, text: None, "fast").diagnosis


def _first_contact_at_the_limit(recording: Recording) -> np.ndarray:
    """Readings with those of electrode 0 that its own contact is part of beyond the others, all at one value."""
    assert recording.frames is not None
    assert recording.protocol is not None
    voltage = np.array(recording.frames.voltage_v, dtype=float)
    voltage[:, recording.protocol.injection_current_a[:, 0] != 0, 0] = 1.2 * voltage.max()
    return voltage


def test_what_is_missing_is_said(recording: Recording) -> None:
    frames = recording.frames
    assert frames is not None
    voltage, phase, press = np.asarray(frames.voltage_v, dtype=float), frames.history.phase, frames.history.press
    cases = {
        "no frames": some_frames(recording, np.zeros(0, dtype=int)),
        "no contacts": with_history(
            recording,
            contact_m=np.zeros((len(phase), 0, 2)),
            depth_m=np.zeros((len(phase), 0)),
            force_n=np.zeros((len(phase), 0)),
        ),
        "rigid block": replace(
            recording, rigid_block=RigidBlock(np.array([0.0, 1e-3, 2e-3]), np.array([3.0, 2.0, 1.0]))
        ),
        "no protocol": replace(recording, protocol=None),
        "no rest frames": some_frames(recording, np.flatnonzero(phase != 0)),
        "channel 0": reading(recording, np.where(np.arange(voltage.shape[2]) == 0, np.nan, voltage)),
        "at the converter's limit": reading(recording, _first_contact_at_the_limit(recording)),
        "1 press:": some_frames(recording, np.flatnonzero(press == press[len(press) // 2])),
        "specimen": replace(recording, specimen=None),
        "no reading is a number": reading(recording, np.full_like(voltage, np.nan)),
        "saturated": reading(recording, np.full_like(voltage, 4.096)),
        "wiring": reading(recording, 1e-3 * np.random.default_rng(0).standard_normal(voltage.shape)),
    }
    for words, bad in cases.items():
        found = verdict(bad)
        assert found.verdict == "cannot_tell", words
        assert not found.claims
        assert words in (found.reason or "")


@pytest.mark.timeout(300)
def test_readings_that_are_no_numbers_are_no_effect(recording: Recording) -> None:
    assert recording.frames is not None
    voltage = np.array(recording.frames.voltage_v, dtype=float)
    voltage[..., 3] = np.nan
    voltage[4::9] = np.nan
    assert verdict(reading(recording, voltage)).verdict == "no_mismatch"
