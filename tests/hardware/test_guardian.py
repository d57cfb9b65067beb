"""A recording killed while it presses: somebody else raises the stage. In real time, across processes."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

from small_experiment import bench_of

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
