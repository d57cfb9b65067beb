"""Electrodes out of place on a disk whose readings follow the closed form for point electrodes, without a mesh."""

import numpy as np
import pytest

from ertskin.diagnosis.any_recording import diagnose_any
from ertskin.diagnosis.tank.placement import Placement, PlacementFit
from ertskin.hardware.recording import Frames, Recording
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

ELECTRODES = 16
RADIUS_M = 0.15
ANGLE = 2 * np.pi * np.arange(ELECTRODES) / ELECTRODES


def tank(shift: np.ndarray, gain: float = 0.0, seed: int = 0) -> Recording:
    """An empty frame; ``shift`` (16,) in radian, ``gain`` of the reading between electrodes 5 and 6."""
    around = np.linspace(0, 2 * np.pi, 360, endpoint=False)
    outline = RADIUS_M * np.stack([np.cos(around), np.sin(around)], axis=1)
    edge = np.stack([RADIUS_M * np.stack([np.cos(a), np.sin(a)], axis=1) for a in (ANGLE - 0.03, ANGLE + 0.03)], axis=1)
    number = np.arange(ELECTRODES)
    reads = np.stack([number, (number + 1) % ELECTRODES], axis=1)
    measured = ~(reads[None, :, :, None] == reads[:, None, None, :]).any(axis=(2, 3))
    current = 1e-3 * (np.eye(ELECTRODES) - np.eye(ELECTRODES)[reads[:, 1]])
    protocol = Protocol.differences(current, reads, measured=measured)
    i, j = np.triu_indices(ELECTRODES, 1)
    away = np.abs(2 * np.sin((ANGLE + shift)[i] / 2 - (ANGLE + shift)[j] / 2))
    clean = protocol.readings(2 / np.pi * 50.0 * np.log(away / 0.01))
    clean[:, 5] *= 1 + gain
    noise = 1e-5 * np.random.default_rng(seed).standard_normal((1, *clean.shape))
    voltage = protocol.gapped(clean + noise).astype(np.float32)
    nothing = np.zeros((1, 0))
    history = History(np.zeros(1), np.zeros(1, int), np.zeros(1, np.uint8), np.zeros((1, 0, 2)), nothing, nothing)
    sensor = Sensor(outline, electrode_edge_m=edge)
    return Recording("disk", "", "", sensor, protocol, Frames(voltage, history))


def placed(recording: Recording) -> Placement:
    assert recording.sensor is not None
    assert recording.protocol is not None
    assert recording.frames is not None
    scan_v = recording.protocol.filled(recording.frames.voltage_v[0].astype(float))
    return PlacementFit(recording.sensor, recording.protocol, scan_v, 1e-5, ()).fit()


def test_a_squeezed_tank_has_electrodes_out_of_place():
    shift = 0.25 * np.sin(2 * ANGLE + 0.4)
    found = diagnose_any(tank(shift), "disk.h5", lambda share, text: None).diagnosis.as_builtins()
    assert {effect["name"] for effect in found["effects"]} == {"electrode_displacement"}
    assert "outline_changed" in {other["name"] for other in found["effects"][0]["alternatives"]}
    assert found["held_out"]["ratio_after"] < 0.3 * found["held_out"]["ratio_before"]
    assert "conformal" in found["reason"]
    assert np.array(found["placement"]["shift_along_rim_m"]) / RADIUS_M == pytest.approx(shift, abs=0.05)


def test_one_electrode_out_of_place_is_named_alone():
    shift = np.zeros(ELECTRODES)
    shift[3] = 0.2
    assert placed(tank(shift)).displaced == (3,)


def test_places_as_good_as_by_hand_are_no_finding():
    assert placed(tank(0.025 * np.random.default_rng(1).standard_normal(ELECTRODES))).displaced == ()


def test_a_gain_moves_no_electrode():
    assert placed(tank(np.zeros(ELECTRODES), gain=0.1)).displaced == ()
