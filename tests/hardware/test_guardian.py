"""A recording killed while it presses: somebody else raises the stage. In real time, across processes."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest
from small_experiment import bench_of

from hardware import guardian
from hardware.failure import LostContact
from hardware.guardian import stand_guard
from hardware.recorder import part_of
from hardware.recording import read_recording
from hardware.virtual.serving import Server

SCRIPT = Path(__file__).with_name("guarded_recording.py")


def test_killed_while_pressing(tmp_path: Path) -> None:
    with ExitStack() as stack:
        bench = bench_of(real_time=True, limits={"travel_speed_m_s": 0.3, "clearance_m": 0.005})
        stack.callback(bench.close)
        bench.stage.homing_m_s = 1.0
        stack.callback(Server([bench.stage, bench.load_cell, bench.reader]).close)
        command = [sys.executable, str(SCRIPT), str(tmp_path / "a.h5"), json.dumps(bench.fields)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert process.stdout is not None
        assert process.stderr is not None
        for line in process.stdout:
            if float(line) >= 7.5e-4:
                break
        process.kill()
        process.wait()
        killed_m = bench.world.depth_m(bench.clock.now())
        # Its end of the pipe is the guardian's too: this waits until that one is gone, and leaves no process behind.
        told = process.stderr.read()
        assert killed_m > 0.0
        assert told.endswith("the stage is up\n")
        assert bench.world.depth_m(bench.clock.now()) < 0.0
    frames = read_recording(part_of(tmp_path / "a.h5")).frames
    assert frames is not None
    assert len(frames) >= 4


class Stage:
    """A stage whose port comes back after so many tries."""

    gone, raised_m = 0, 0.0

    def __init__(self, *_line: object) -> None:
        if Stage.gone > 0:
            Stage.gone -= 1
            raise LostContact("can't be opened")

    def raise_by(self, height_m: float, _speed_m_s: float) -> None:
        """Straight up."""
        Stage.raised_m += height_m

    def recover(self) -> None:
        """Nothing was wrong with it."""

    close = recover


@pytest.mark.parametrize(
    ("word", "gone", "status", "raised_m"),
    [(b"well\n", 0, 0, 0.0), (b"", 0, 0, 0.01), (b"", 40, 0, 0.01), (b"", 1000, 1, 0.0)],
)
def test_it_tries_until_the_stage_is_back(
    word: bytes, gone: int, status: int, raised_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Stage, "gone", gone)
    monkeypatch.setattr(Stage, "raised_m", 0.0)
    monkeypatch.setattr(guardian, "SerialTransport", lambda *_port: None)
    monkeypatch.setattr(guardian, "STAGES", {"grbl": Stage})
    monkeypatch.setattr(guardian.SystemClock, "sleep", lambda _clock, _seconds: None)
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(word)))
    words = {"stage": {"driver": "grbl", "port": "/dev/stage"}, "height_m": 0.01, "speed_m_s": 0.02}
    assert stand_guard(json.dumps(words)) == status
    assert Stage.raised_m == raised_m
