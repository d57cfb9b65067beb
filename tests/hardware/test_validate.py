"""What the examination of a recording says, against recordings whose flaws are known."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from example_recording import example

from ertskin.hardware.recording import Frames, write_recording
from ertskin.hardware.validate import rest_quality, saturated_share, validate
from ertskin.physics.protocol import Protocol, electrode_pairs, pair_resistances

PROTOCOL = Protocol.against_sink(electrode_pairs(8), 8, 1e-3, adc_limit_v=1.0)


def rest(seed: int = 0, frames: int = 30, noise_v: float = 1e-3) -> np.ndarray:
    """Rest frames (T,28,8) of a random passive network with white noise."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(8, 8))
    transfer = 100.0 * root @ root.T
    clean = PROTOCOL.readings(pair_resistances(transfer))
    return clean + noise_v * random.normal(size=(frames, *clean.shape))


def test_noise_is_measured() -> None:
    quality = rest_quality(rest(noise_v=1e-3), PROTOCOL)
    assert quality.noise_v == pytest.approx(1e-3, rel=0.05)
    assert quality.drift_v < 0.3e-3
    assert quality.spike_share < 1e-3


def test_drifting_contacts_are_not_noise() -> None:
    gain = 1.0 + 0.02 * np.random.default_rng(1).normal(size=(30, 1, 1))
    quality = rest_quality(rest() * gain, PROTOCOL)
    assert quality.noise_v == pytest.approx(1e-3, rel=0.1)
    assert quality.drift_v > 5e-3


def test_spikes_are_counted() -> None:
    frames = rest()
    random = np.random.default_rng(2)
    hit = random.random(frames.shape) < 0.01
    quality = rest_quality(np.where(hit, frames + 0.1, frames), PROTOCOL)
    assert quality.spike_share == pytest.approx(0.01, rel=0.3)
    assert quality.noise_v == pytest.approx(1e-3, rel=0.15)


def test_the_electrode_that_reads_wrong_is_named() -> None:
    frames = rest(noise_v=1e-5)
    frames[:, :, 5] *= 1.05
    quality = rest_quality(frames, PROTOCOL)
    assert quality.reciprocity_defect > 0.005
    assert quality.worst_electrode == 5
    assert quality.worst_factor > 1.5


def test_a_passive_network_has_no_defect() -> None:
    assert rest_quality(rest(noise_v=0.0), PROTOCOL).reciprocity_defect < 1e-12


def test_saturation_is_a_share_of_readings() -> None:
    voltage = np.zeros((2, 5, 10))
    voltage[0, 0, :] = 1.0
    assert saturated_share(voltage, PROTOCOL) == pytest.approx(0.1)


def test_findings_of_a_sound_recording(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.h5", example())
    findings = validate(tmp_path / "a.h5")
    assert findings.errors == []
    facts = {fact.name for fact in findings.facts}
    assert {"electrodes", "frames", "presses", "saturated", "noise at rest", "reciprocity defect", "spikes"} <= facts
    assert findings.number("frames") == 5
    assert findings.number("presses") == 1


def test_findings_warn(tmp_path: Path) -> None:
    recording = example()
    assert recording.frames is not None
    history = dataclasses.replace(
        recording.frames.history, phase=np.full(5, 2, np.uint8), time_s=np.array([0.0, 1.0, 1.0, 2.0, 3.0])
    )
    frames = Frames(recording.frames.voltage_v, history)
    write_recording(tmp_path / "a.h5", dataclasses.replace(recording, frames=frames))
    text = " ".join(validate(tmp_path / "a.h5").warnings)
    for word in ("does not increase", "no rest frames", "no known place"):
        assert word in text


def test_a_refusal_is_an_error_not_an_exception(tmp_path: Path) -> None:
    (tmp_path / "a.h5").write_bytes(b"")
    findings = validate(tmp_path / "a.h5")
    assert len(findings.errors) == 1
    assert findings.facts == []


def test_the_tanks_wrong_electrode(shared_data: Path) -> None:
    findings = validate(shared_data / "real" / "ktc2023_tank_a.h5")
    assert findings.errors == []
    assert findings.number("electrodes") == 32
    assert findings.number("reciprocity defect") > 0.01
