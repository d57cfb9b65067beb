"""Scans from a reader that fails and comes back, from a recording played again, and from the virtual bench."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
from test_live_network import PROTOCOL

from ertskin.hardware.recording import Frames
from ertskin.hardware.virtual.fault_trial import small_bench
from ertskin.live.export import export_onnx
from ertskin.live.sources import scans_of_reader, scans_of_recording
from ertskin.models.reciprocal import ReciprocalNetwork
from ertskin.models.reconstruction import Reconstruction
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import taxel_grid_m


def test_a_reader_that_fails_is_reported_and_read_again() -> None:
    bench = small_bench()
    rig = bench.open()
    said: list[str] = []
    ending = threading.Event()
    scans = scans_of_reader(rig.reader, rig.protocol, said.append, ending)
    assert [next(scans).sequence for _ in range(3)] == [0, 1, 2]
    bench.reader.unplug(1.0)
    # Plugged in again the board counts anew.
    assert [next(scans).sequence for _ in range(2)] == [0, 1]
    assert any("lost" in text for text in said)
    ending.set()
    assert list(scans) == []
    rig.close()
    bench.close()


def test_a_recording_is_played_from_its_first_rest_at_its_pace() -> None:
    nothing = np.full((6, 1), np.nan)
    phase = np.array([2, 0, 1, 2, 3, 0], np.uint8)
    history = History(0.1 * np.arange(6), np.zeros(6, np.int64), phase, np.full((6, 1, 2), np.nan), nothing, nothing)
    frames, protocol = Frames(np.ones((6, 28, 8), np.float32), history), PROTOCOL
    begin = time.monotonic()
    played = list(scans_of_recording(frames, protocol, 2.0, threading.Event()))
    assert [scan.sequence for scan in played] == [1, 2, 3, 4, 5]
    assert time.monotonic() - begin >= 0.4 / 2.0
    ended = threading.Event()
    ended.set()
    assert list(scans_of_recording(frames, protocol, 1e-3, ended)) == []


def test_the_virtual_bench_is_watched_until_interrupted(tmp_path: Path) -> None:
    protocol = Protocol.against_sink(electrode_pairs(24), 24, 1e-4)
    network = ReciprocalNetwork(276, taxel_grid_m((0.12, 0.12), 6, 6).tolist()).eval()
    export_onnx(Reconstruction(protocol, network), tmp_path / "model.onnx")
    settings = [f"network={tmp_path / 'model.onnx'}", "stream=true", "zero_scans=2"]
    command = [sys.executable, "-m", "ertskin.cli", "live", *settings]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path)
    assert process.stdout is not None
    messages = [json.loads(process.stdout.readline()) for _ in range(5)]
    process.send_signal(signal.SIGINT)
    _, wrong = process.communicate(timeout=90)
    assert process.returncode == 130
    unknown = "ertskin: this network does not know its resting skin: zeroing alone"
    assert wrong.splitlines() == [unknown, "ertskin: stopped"]
    assert [message["frame"] for message in messages] == [1, 2, 3, 4, 5]
    assert [message["zeroing"] for message in messages] == [True, True, False, False, False]
    assert abs(messages[0]["header"]["stamp"]["sec"] - time.time()) < 600
    assert len(messages[0]["force_map"]["data"]) == 36
