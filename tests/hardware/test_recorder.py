"""The recorder: nothing acknowledged is ever lost, and a half-done recording is gone on with."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from killed_recorder import PLAN, SHAPE, voltage
from small_experiment import bench_of, experiment_of, plan_of_presses, recorder_of

from hardware.recorder import Recorder, next_press, part_of
from hardware.recording import Recording, RecordingError, read_recording
from hardware.validate import validate

SCRIPT = Path(__file__).with_name("killed_recorder.py")


def kill_after(path: Path, frames: int, seconds: float) -> int:
    """Record, kill without warning so many frames and seconds later; the frames acknowledged before."""
    process = subprocess.Popen([sys.executable, str(SCRIPT), str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    begun = acknowledged = int(process.stdout.readline().split()[1])
    while acknowledged < begun + frames:
        acknowledged = int(process.stdout.readline())
    timer = threading.Timer(seconds, process.kill)
    timer.start()
    for line in process.stdout:
        if line.endswith("\n"):
            acknowledged = int(line)
    process.wait()
    timer.cancel()
    return acknowledged


def check_frames(path: Path, acknowledged: int) -> int:
    """Every acknowledged frame is there, whole; how many there are."""
    frames = read_recording(part_of(path)).frames
    assert frames is not None
    assert len(frames) >= acknowledged
    for number in range(len(frames)):
        np.testing.assert_array_equal(frames.voltage_v[number], voltage(number))
    np.testing.assert_array_equal(frames.history.time_s, 0.5 * np.arange(len(frames)))
    return len(frames)


def test_killed_at_random_moments(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    path = tmp_path / "killed.h5"
    had = 0
    for _ in range(4):
        acknowledged = kill_after(path, int(rng.integers(5, 40)), float(rng.uniform(0.0, 0.02)))
        assert acknowledged >= had
        had = check_frames(path, acknowledged)
    assert had >= 20
    assert any("half done" in warning for warning in validate(part_of(path)).warnings)


def test_going_on_gives_the_whole_plan(tmp_path: Path) -> None:
    plan = plan_of_presses(3)
    bench = bench_of()
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")

    def stop(progress: object) -> None:
        if progress.press == 1 and progress.depth_m == 1e-3:  # type: ignore[attr-defined]
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        experiment_of(bench, recorder, show=stop).run(plan)
    recorder.close()
    bench.close()
    bench = bench_of()
    recorder, so_far = Recorder.resumed(tmp_path / "a.h5", plan)
    assert next_press(so_far.frames) == 2
    before = so_far.frames
    assert before is not None
    experiment_of(bench, recorder).run(plan, next_press(before))
    frames = recorder.finish().frames
    bench.close()
    assert frames is not None
    assert len(frames) == len(before) + plan.presses[2].frames + 1
    np.testing.assert_array_equal(frames.voltage_v[: len(before)], before.voltage_v)
    assert list(np.unique(frames.history.press)) == [0, 1, 2, 3]
    assert not part_of(tmp_path / "a.h5").exists()


def test_another_plan_is_not_mixed_in(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.h5", Recording("", "", ""), PLAN, SHAPE, counts=False)
    recorder.close()
    with pytest.raises(RecordingError, match="another plan"):
        Recorder.resumed(tmp_path / "a.h5", plan_of_presses())


def test_two_recorders_do_not_share_a_file(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    process = subprocess.Popen([sys.executable, str(SCRIPT), str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.readline()
    process.stdout.readline()
    try:
        with pytest.raises(RecordingError, match="another process"):
            Recorder.resumed(path, PLAN)
        with pytest.raises(RecordingError, match="already there"):
            Recorder(path, Recording("", "", ""), PLAN, SHAPE, counts=False)
        before = len(read_recording(part_of(path)).frames or [])
        deadline = time.monotonic() + 60.0
        while len(read_recording(part_of(path)).frames or []) == before:
            assert time.monotonic() < deadline
    finally:
        process.kill()
        process.wait()


def test_a_finished_recording_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "a.h5").write_text("mine")
    with pytest.raises(RecordingError, match="already there"):
        Recorder(tmp_path / "a.h5", Recording("", "", ""), PLAN, SHAPE, counts=False)
    assert (tmp_path / "a.h5").read_text() == "mine"
