"""Recordings killed without warning: ``python experiments/bench/kills.py [KILLS] [SEED]``; writes kills.md.

Each recording runs on the virtual bench through the serial path (springs for a skin, so that frames come fast), says
every frame that is kept, and is killed at a random moment, gone on with and killed again.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import numpy as np

from ertskin.hardware.experiment import Experiment
from ertskin.hardware.plan import Plan, Press, ramp
from ertskin.hardware.recorder import Recorder, next_press, part_of
from ertskin.hardware.recording import Recording, read_recording
from ertskin.hardware.virtual.fault_trial import small_bench

PLAN = Plan("killed", (Press(((0.03, 0.03),), ramp(1e-3, 1e-4), rest_s=0.5),) * 200)


def record(path: Path) -> None:
    """Record until killed, telling how many frames are kept."""
    bench = small_bench()
    rig = bench.open()
    first = 0
    if part_of(path).exists():
        recorder, so_far = Recorder.resumed(path, PLAN)
        first = next_press(so_far.frames)
    else:
        header = Recording("killed", "", "", rig.sensor, rig.protocol)
        recorder = Recorder(path, header, PLAN, rig.protocol.shape, counts=True)
    print(recorder.frames, flush=True)
    Experiment(rig, recorder, 0.0, lambda progress: print(progress.frame, flush=True)).run(PLAN, first)


def killed(path: Path, seconds: float) -> int:
    """Frames reported as kept by a recording killed after so many seconds from its first word."""
    # Who is killed can't tidy up: its folder of ports goes with ours.
    environment = {**os.environ, "TMPDIR": str(path.parent)}
    command = [sys.executable, __file__, "--record", str(path)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    assert process.stdout is not None
    reported = int(process.stdout.readline() or 0)
    timer = threading.Timer(seconds, process.kill)
    timer.start()
    for line in process.stdout:
        if line.endswith("\n"):
            reported = int(line)
    process.wait()
    timer.cancel()
    return reported


def main(kills: int = 50, seed: int = 0) -> None:
    """Kill, look, go on, kill again; a new recording every ten."""
    rng = np.random.default_rng(seed)
    opened = kept = lost = frames_lost = 0
    most = 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(kills):
            path = Path(folder) / f"{number // 10}.h5"
            reported = killed(path, float(rng.uniform(0.0, 2.0)))
            frames = read_recording(part_of(path)).frames
            opened += frames is not None
            found = 0 if frames is None else len(frames)
            kept += found >= reported
            lost += found < reported
            frames_lost += max(0, reported - found)
            most = max(most, found)
    text = [
        f"Seed {seed}. {kills} recordings killed with SIGKILL 0 to 2 s after their first frame count, each gone on",
        "with and killed again up to ten times.",
        "",
        "| kills | opened | every acknowledged frame there | acknowledged frames lost | most frames in one |",
        "| --- | --- | --- | --- | --- |",
        f"| {kills} | {opened} | {kept} | {frames_lost} | {most} |",
        "",
    ]
    Path(__file__).with_name("kills.md").write_text("\n".join(text))
    print("\n".join(text))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--record"]:
        record(Path(sys.argv[2]))
    else:
        main(*(int(argument) for argument in sys.argv[1:3]))
