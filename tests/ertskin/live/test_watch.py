"""A live skin followed at rest, and told when it is no longer the one that was trained."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from test_live_network import PROTOCOL, TAXEL_M, reconstruction

from ertskin.hardware.instrument import Scan
from ertskin.live.export import export_onnx
from ertskin.live.message import line_of, message_of
from ertskin.live.predictor import Kind, Predictor
from ertskin.live.session import LEFT, LiveFrame, Session
from ertskin.live.watch import TOO_MANY, Watch
from ertskin.models.estimate import Estimate
from ertskin.models.monitor import SkinMonitor
from ertskin.models.novelty import Novelty
from ertskin.physics.calibration.following import RestingSkin

NOISE_V = 1e-3
RNG = np.random.default_rng(0)
SLOPE_V = 0.5 * RNG.standard_normal((28, 3))
REST_V = RNG.standard_normal(28)
PRESS_V = 0.1 * np.linalg.qr(np.column_stack([SLOPE_V, RNG.standard_normal(28)]))[0][:, 3]


class Presses:
    """A network that knows one press, and says how hard by the change it is shown."""

    reads_coordinates = False

    def __init__(self) -> None:
        self.kind = Kind("touch", PROTOCOL.shape, np.array(TAXEL_M), 0.5, 0.0)
        self.rehearsed = 0

    def rehearse(self, coordinates_v: np.ndarray) -> None:
        self.rehearsed += 1

    def estimate(self, change_v: np.ndarray) -> Estimate:
        force = np.zeros((len(change_v), 9))
        force[:, 4] = change_v.reshape(len(change_v), -1) @ PROTOCOL.orthonormal @ PRESS_V / (PRESS_V @ PRESS_V)
        force[force < 0.2] = 0.0
        return Estimate(force, force > 0)


def watch() -> Watch:
    limits = np.array([25.0, 2.5, 1.5])
    matrix = np.linalg.qr(np.column_stack([PRESS_V, np.eye(28)[:, :27]]))[0] / NOISE_V
    novelty = Novelty(matrix, np.array([1e4]), 0.0, NOISE_V, limits)
    return Watch(SkinMonitor(RestingSkin(REST_V, SLOPE_V, NOISE_V, limit=2.0), novelty), PROTOCOL)


def scan(k: int, drift: np.ndarray, pressed: float = 0.0, strange_v: float = 0.0) -> Scan:
    """The skin drifted by relative changes (3,); a press scales with the sheet, the last of them."""
    rng = np.random.default_rng(k)
    coordinates = REST_V + SLOPE_V @ drift + (1.0 + drift[-1]) * pressed * PRESS_V
    readings = PROTOCOL.orthonormal @ coordinates + NOISE_V * rng.standard_normal(28 * 8)
    readings[::5] += strange_v
    return Scan(0.5 * k, readings.reshape(28, 8).astype(np.float32), saturated=np.zeros((28, 8), bool))


def session() -> Session:
    return Session(Presses(), 4, watch=watch())  # type: ignore[arg-type]


def test_a_drifting_skin_keeps_its_forces() -> None:
    """Contacts and sheet drift by a tenth over ten minutes; every tenth scan is pressed with 3 N."""
    followed, zeroed = session(), Session(Presses(), 4)  # type: ignore[arg-type]
    forces: list[list[float]] = [[], []]
    for k in range(1200):
        drift = np.array([0.1, -0.1, 0.1]) * k / 1200
        pressed = 3.0 if k % 10 == 9 and k > 10 else 0.0
        for frames, watched in zip(forces, (followed, zeroed), strict=True):
            frame = watched.see(scan(k, drift, pressed))
            if pressed:
                frames.append(sum(contact.force_n for contact in frame.contacts))
    following, zeroing = (np.sqrt(np.mean((np.array(found) - 3.0)[-30:] ** 2)) for found in forces)
    assert following < 0.05
    assert zeroing > 0.2


def test_rest_is_distinguished_from_touch_and_a_hold_stays_one() -> None:
    watched = session()
    rest = [watched.see(scan(k, np.zeros(3))) for k in range(100)]
    assert all(not frame.contacts for frame in rest)
    assert all(frame.novelty is not None and frame.novelty <= 1.0 for frame in rest[4:])
    held = [watched.see(scan(k, np.zeros(3), 1.0)) for k in range(100, 700)]
    assert all(len(frame.contacts) == 1 for frame in held)
    assert held[-1].contacts[0].force_n == pytest.approx(1.0, abs=0.05)
    assert not any(frame.left for frame in held)
    assert not watched.see(scan(700, np.zeros(3))).contacts


def test_the_network_is_rehearsed_while_nothing_touches() -> None:
    network = Presses()
    watched = Session(network, 4, watch=watch())  # type: ignore[arg-type]
    for k in range(10):
        watched.see(scan(k, np.zeros(3)))
        assert network.rehearsed == max(0, k - 4)  # not before the answer is out
        watched.rehearse()
        watched.rehearse()
    assert network.rehearsed == 6
    watched.see(scan(10, np.zeros(3), 1.0))
    watched.rehearse()
    assert network.rehearsed == 6


def test_a_sheet_that_jumped_while_nobody_looked_is_no_touch() -> None:
    watched = session()
    for k in range(10):
        watched.see(scan(k, np.zeros(3)))
    frame = watched.see(scan(7200, np.array([0.0, 0.0, 0.2])))
    assert frame.contacts == ()
    assert frame.sheet_change == pytest.approx(0.2, abs=2e-3)
    assert watched.see(scan(7201, np.array([0.0, 0.0, 0.2]), 2.0)).contacts[0].force_n == pytest.approx(2.0, abs=0.05)


def test_a_strange_skin_is_said_to_have_left_and_comes_back() -> None:
    watched = session()
    for k in range(10):
        watched.see(scan(k, np.zeros(3)))
    strange: list[LiveFrame] = [watched.see(scan(k, np.zeros(3), 2.0, 8e-3)) for k in range(10, 20)]
    assert [frame.left for frame in strange] == [False] * (TOO_MANY - 1) + [True] * (11 - TOO_MANY)
    assert strange[-1].novelty is not None
    assert strange[-1].novelty > 1.0
    assert LEFT in strange[-1].warnings
    usual = [watched.see(scan(k, np.zeros(3), 2.0)) for k in range(20, 50)]
    assert not usual[-1].left
    message = json.loads(line_of(message_of(usual[-1], np.array(TAXEL_M))))
    assert message["novelty"] < 1.0
    assert message["novelty_false_alarms"] == 1e-3
    assert not message["left"]


def test_the_monitor_goes_with_the_exported_network(tmp_path: Path) -> None:
    model = reconstruction("reciprocal")
    model.monitor = watch().monitor
    model.save(tmp_path / "model.pt")
    export_onnx(type(model).load(tmp_path / "model.pt"), tmp_path / "model.onnx")
    found = Predictor(tmp_path / "model.onnx").monitor
    assert found is not None
    np.testing.assert_array_equal(found.resting.slope_v, SLOPE_V)
    np.testing.assert_array_equal(found.novelty.limits, [25.0, 2.5, 1.5])
