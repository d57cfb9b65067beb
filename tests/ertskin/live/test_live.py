"""Watching live: zeroing, contacts, drift; the page's server and its guards; the command on a recording."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import urllib.request
from pathlib import Path
from urllib.error import HTTPError

import numpy as np
import pytest
from test_live_network import PROTOCOL, TAXEL_M, reconstruction

from ertskin.hardware.instrument import Scan
from ertskin.hardware.recording import Frames, Recording, read_recording, write_recording
from ertskin.hardware.validate import validate
from ertskin.live.export import export_onnx
from ertskin.live.keeping import Keeper
from ertskin.live.message import fault_of, line_of, message_of
from ertskin.live.predictor import Kind, Predictor
from ertskin.live.server import GUARD, PAGE, Channel, LiveServer
from ertskin.live.session import Session
from ertskin.models.estimate import Estimate
from ertskin.physics.history import History


class Obedient:
    """A predictor that answers what it is told to."""

    reads_coordinates = False

    def __init__(self, force_n: float = 0.0) -> None:
        self.force_n = force_n
        self.kind = Kind(False, (28, 8), np.array(TAXEL_M), 0.5, 0.0)

    def estimate(self, change_v: np.ndarray) -> Estimate:
        force = np.zeros((1, 9))
        force[0, 4] = self.force_n
        return Estimate(force, force > 0)


def scans(frames: int, offset_v: float = 0.0, seed: int = 0) -> list[Scan]:
    """Scans with a millivolt of noise, untouched but for an offset."""
    rng = np.random.default_rng(seed)
    voltage = 1.0 + offset_v + 1e-3 * rng.normal(size=(frames, 28, 8))
    return [Scan(0.5 * k, one.astype(np.float32), saturated=np.zeros((28, 8), bool)) for k, one in enumerate(voltage)]


def session(force_n: float = 0.0) -> Session:
    return Session(Obedient(force_n))  # type: ignore[arg-type]


def test_begins_with_zeroing() -> None:
    watched = session(2.0)
    seen = [watched.see(scan) for scan in scans(4) + scans(2, 0.1)]
    assert [frame.zeroing for frame in seen] == [True] * 4 + [False] * 2
    assert [len(frame.contacts) for frame in seen] == [0] * 4 + [1] * 2
    assert seen[-1].contacts[0].force_n == 2.0
    assert seen[-1].contacts[0].x_m == pytest.approx(0.06)


def test_noise_and_spikes_are_no_touch_a_light_press_is() -> None:
    """A network always finds something: it is asked only where there is more than noise."""
    watched = session(2.0)
    untouched = [watched.see(scan) for scan in scans(200)]
    assert [len(frame.contacts) for frame in untouched] == [0] * 200
    spiky = scans(1)[0].voltage_v.copy()
    spiky[::9, 0] += 0.3
    assert watched.see(Scan(100.0, spiky)).contacts == ()
    light = [watched.see(scan) for scan in scans(50, 2e-3)]
    assert [len(frame.contacts) for frame in light] == [1] * 50
    assert light[-1].rate_hz == pytest.approx(2.0)
    known = Session(Obedient(2.0), 1, noise_v=1e-3)  # type: ignore[arg-type]
    assert [len(known.see(scan).contacts) for scan in scans(50) + scans(1, 0.01)] == [0] * 50 + [1]


def test_drift_is_reported_until_zeroed() -> None:
    watched = session()
    quiet = [watched.see(scan) for scan in scans(10)]
    assert all(frame.drift < 1.0 for frame in quiet)
    off = [watched.see(scan) for scan in scans(6, 0.01)]
    assert off[-1].drift == pytest.approx(1.4826 * 10.0 / np.sqrt(1.25), rel=0.2)
    assert any("drifted" in text for text in off[-1].warnings)
    watched.zero()
    again = [watched.see(scan) for scan in scans(8, 0.01)]
    assert again[-1].drift < 1.0


def test_a_touch_is_no_drift() -> None:
    watched = session(1.0)
    for scan in scans(4):
        watched.see(scan)
    assert watched.see(scans(1, 0.1)[0]).drift == 0.0


def test_lost_and_saturated_scans_are_reported() -> None:
    watched = session()
    scan = scans(1)[0]
    frame = watched.see(Scan(0.0, scan.voltage_v, saturated=np.ones((28, 8), bool), lost=2))
    assert frame.lost == 2
    assert {"2 scans lost", "1e+02 % of readings saturated"} <= set(frame.warnings)


def test_a_message_has_the_shapes_of_ros() -> None:
    watched = session(2.0)
    frame = [watched.see(scan) for scan in scans(4) + scans(6, 0.1)[4:]][-1]
    message = json.loads(line_of(message_of(frame, np.array(TAXEL_M))))
    assert message["header"] == {"stamp": {"sec": 2, "nanosec": 500000000}, "frame_id": "skin"}
    assert message["contacts"] == [
        {"position": {"x": 0.06, "y": 0.06, "z": 0.0}, "force": {"x": 0.0, "y": 0.0, "z": -2.0}}
    ]
    assert message["force_map"]["layout"]["dim"][0] == {"label": "taxel", "size": 9, "stride": 9}
    assert message["force_map"]["data"][4] == 2.0
    assert message["recorded_frames"] is None
    assert message_of(frame, np.array(TAXEL_M), 1e9, 7)["header"]["stamp"]["sec"] == 1_000_000_002  # type: ignore[index]
    assert json.loads(line_of(fault_of("cable out", 3.0))) == {
        "header": {"stamp": {"sec": 3, "nanosec": 0}, "frame_id": "skin"},
        "fault": "cable out",
    }


# -------------------------------------------------------------------------------------------------------- the page


def asked(url: str, method: str = "GET", **headers: str) -> str:
    request = urllib.request.Request(url, method=method, headers=headers)
    with urllib.request.urlopen(request, timeout=60) as answer:
        return str(answer.read().decode())


def test_the_page_and_its_orders() -> None:
    done: list[str] = []

    def zero() -> str:
        done.append("zero")
        return "zeroing"

    server = LiveServer(Channel(), 0, {"/zero": zero})
    assert server.url.startswith("http://127.0.0.1:")
    assert asked(server.url) == PAGE.read_text()
    assert asked(server.url + "zero", "POST", **{GUARD: "1"}) == "zeroing"
    with pytest.raises(HTTPError, match="403"):
        asked(server.url + "zero", "POST")
    with pytest.raises(HTTPError, match="403"):
        asked(server.url, Host="elsewhere.example")
    with pytest.raises(HTTPError, match="404"):
        asked(server.url + "etc/passwd")
    assert done == ["zero"]
    server.close()


def test_the_stream_gives_every_listener_the_newest() -> None:
    channel = Channel()
    server = LiveServer(channel, 0, {})
    stop = threading.Event()

    def speak() -> None:
        number = 0
        while not stop.wait(0.02):
            number += 1
            channel.send(json.dumps({"frame": number}))

    threading.Thread(target=speak, daemon=True).start()
    for path in ("stream", "events"):
        with urllib.request.urlopen(server.url + path, timeout=60) as answer:
            lines = [line for line in (answer.readline().decode().strip() for _ in range(12)) if line]
        numbers = [json.loads(line.removeprefix("data: "))["frame"] for line in lines]
        assert numbers == sorted(set(numbers))
        assert len(numbers) >= 6
    stop.set()
    server.close()


def test_the_page_takes_nothing_from_elsewhere() -> None:
    text = PAGE.read_text()
    assert "http://" not in text
    assert "https://" not in text


def test_what_is_seen_can_be_kept(tmp_path: Path) -> None:
    watched, keeper = session(1.0), Keeper(tmp_path, "rig", None, PROTOCOL)
    assert keeper.end() == "nothing is being recorded"
    assert keeper.frames is None
    assert "recording to" in keeper.turn()
    for scan in scans(4) + scans(6, 0.1)[4:]:
        keeper.keep(scan, watched.see(scan))
    assert keeper.frames == 6
    assert "6 frames" in keeper.turn()
    (path,) = tmp_path.glob("live-*.h5")
    frames = read_recording(path).frames
    assert frames is not None
    assert list(frames.history.phase) == [0, 0, 0, 0, 2, 2]
    assert validate(path).errors == []


def test_a_recording_played_as_a_stream(tmp_path: Path) -> None:
    model = reconstruction("reciprocal")
    model.save(tmp_path / "model.pt")
    voltage = np.concatenate([np.ones((1, 28, 8)), 1.0 + 0.01 * np.random.default_rng(0).normal(size=(5, 28, 8))])
    nothing = np.full((6, 1), np.nan)
    phase = np.array([0, 2, 2, 2, 2, 2], np.uint8)
    history = History(0.5 * np.arange(6), np.zeros(6, np.int64), phase, np.full((6, 1, 2), np.nan), nothing, nothing)
    recording = Recording("r", "", "", None, PROTOCOL, Frames(voltage.astype(np.float32), history))
    write_recording(tmp_path / "played.h5", recording)
    export_onnx(model, tmp_path / "model.onnx")
    # An exported network runs where there is no torch.
    script = (
        "import sys; sys.modules['torch'] = sys.modules['lightning'] = None\n"
        "from ertskin.cli import main; sys.exit(main())"
    )
    settings = [f"network={tmp_path / 'model.onnx'}", "stream=true", "speed=0", f"recording={tmp_path / 'played.h5'}"]
    words = [sys.executable, "-c", script, "live", *settings]
    done = subprocess.run(words, capture_output=True, text=True, check=True, cwd=tmp_path)
    messages = [json.loads(line) for line in done.stdout.splitlines()]
    assert [message["frame"] for message in messages] == [1, 2, 3, 4, 5, 6]
    assert messages[0]["zeroing"]
    wanted = model.estimate((voltage[1:] - voltage[0]).astype(np.float32)).force_map_n
    np.testing.assert_allclose([message["force_map"]["data"] for message in messages[1:]], wanted, atol=2e-3)
    assert Predictor(tmp_path / "model.onnx").kind.shape == (28, 8)
