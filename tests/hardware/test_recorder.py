"""The recorder: nothing acknowledged is ever lost, and a half-done recording is gone on with."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from killed_recorder import PLAN, SHAPE, WHOLE, voltage
from small_experiment import bench_of, experiment_of, plan_of_presses, recorder_of

from ertskin.hardware.recorder import FrameEntry, Recorder, half_done_plan, next_press, part_of
from ertskin.hardware.recording import Recording, RecordingError, read_recording, write_recording
from ertskin.hardware.validate import validate
from ertskin.physics.history import Phase

SCRIPT = Path(__file__).with_name("killed_recorder.py")


def kill_after(path: Path, frames: int, seconds: float) -> tuple[int, int]:
    """Record, kill without warning so many frames and seconds later; the frames it began with, and acknowledged."""
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
    return begun, acknowledged


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
    had = halves = 0
    for _ in range(4):
        begun, acknowledged = kill_after(path, int(rng.integers(5, 40)), float(rng.uniform(0.0, 0.02)))
        assert begun == had - had % WHOLE
        if begun < had:
            halves += 1
            attempts = sorted(tmp_path.glob(f"killed.press_{begun // WHOLE}_cut_off_*.h5"))
            half = read_recording(attempts[-1]).frames
            assert half is not None
            np.testing.assert_array_equal(half.voltage_v, [voltage(number) for number in range(begun, had)])
        had = check_frames(path, acknowledged)
    assert had >= 20
    assert len(list(tmp_path.glob("*_cut_off_*"))) == halves > 0
    assert any("half done" in warning for warning in validate(part_of(path)).warnings)


def test_going_on_repeats_the_press_that_was_cut_off(tmp_path: Path) -> None:
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
    cut_off = read_recording(part_of(tmp_path / "a.h5")).frames
    recorder, so_far = Recorder.resumed(tmp_path / "a.h5", plan)
    assert next_press(so_far.frames) == 1
    before, aside = so_far.frames, tmp_path / "a.press_1_cut_off_1.h5"
    assert before is not None
    assert cut_off is not None
    assert recorder.set_apart == aside
    experiment_of(bench, recorder).run(plan, 1)
    frames = recorder.finish().frames
    bench.close()
    assert frames is not None
    assert len(frames) == plan.frames
    np.testing.assert_array_equal(frames.voltage_v[: len(before)], before.voltage_v)
    assert list(np.bincount(frames.history.press)) == [*(press.frames for press in plan.presses), 1]
    half = read_recording(aside)
    assert half.frames is not None
    np.testing.assert_array_equal(half.frames.voltage_v, cut_off.voltage_v[len(before) :])
    assert half.comment.startswith(f"press 1 was cut off after {len(half.frames)} frames and is repeated in a.h5")
    assert aside.name in (tmp_path / "a.h5.log").read_text()
    assert {path.name for path in tmp_path.iterdir()} == {"a.h5", "a.h5.log", aside.name}


def test_killed_again_before_the_first_frame_loses_nothing(tmp_path: Path) -> None:
    plan, bench = plan_of_presses(1), bench_of()
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")

    def stop(progress: object) -> None:
        if progress.depth_m == 1e-3:  # type: ignore[attr-defined]
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        experiment_of(bench, recorder, show=stop).run(plan)
    recorder.close()
    for _ in range(2):
        recorder, so_far = Recorder.resumed(tmp_path / "a.h5", plan)
        assert len(so_far.frames or ()) == next_press(so_far.frames) == 0
        recorder.close()
    with pytest.raises(KeyboardInterrupt):
        experiment_of(bench, Recorder.resumed(tmp_path / "a.h5", plan)[0], show=stop).run(plan)
    bench.close()


class _Interrupted:
    """A time in whose writing a signal arrives."""

    def __array__(self, *_: object, **__: object) -> np.ndarray:
        raise KeyboardInterrupt


def test_a_signal_within_a_frame_leaves_whole_frames(tmp_path: Path) -> None:
    plan, bench = plan_of_presses(1), bench_of()
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")
    experiment_of(bench, recorder).run(plan)
    nothing = np.full(1, np.nan)
    last = read_recording(part_of(tmp_path / "a.h5")).frames
    assert last is not None
    voltage_v = last.voltage_v[-1]
    count = None if last.adc_count is None else last.adc_count[-1]
    entry = FrameEntry(
        voltage_v, count, cast(float, _Interrupted()), 1, Phase.REST, np.full((1, 2), np.nan), nothing, nothing
    )
    with pytest.raises(KeyboardInterrupt):
        recorder.append(entry)
    recorder.close()
    bench.close()
    frames = read_recording(part_of(tmp_path / "a.h5")).frames
    assert frames is not None
    assert len(frames) == plan.frames
    np.testing.assert_array_equal(frames.history.time_s, last.history.time_s)


def test_a_whole_plan_killed_before_its_end_is_not_repeated(tmp_path: Path) -> None:
    plan, bench = plan_of_presses(1), bench_of()
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")
    experiment_of(bench, recorder).run(plan)
    recorder.close()
    recorder, so_far = Recorder.resumed(tmp_path / "a.h5", plan)
    assert recorder.set_apart is None
    experiment_of(bench, recorder).run(plan, next_press(so_far.frames))
    frames = recorder.finish().frames
    bench.close()
    assert frames is not None
    assert len(frames) == plan.frames


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


def test_presses_are_added_to_a_finished_recording_and_a_cut_off_one_is_repeated(tmp_path: Path) -> None:
    path, bench = tmp_path / "a.h5", bench_of()
    first = plan_of_presses(2)
    recorder = recorder_of(bench, first, path)
    experiment_of(bench, recorder).run(first)
    finished = recorder.finish()
    assert finished.frames is not None
    bytes_before = path.read_bytes()
    bench.close()
    more = replace(plan_of_presses(1), first=2)

    def stop(progress: object) -> None:
        if progress.depth_m == 1e-3:  # type: ignore[attr-defined]
            raise KeyboardInterrupt

    bench = bench_of()
    recorder = Recorder.adding_to(path, finished, more)
    with pytest.raises(KeyboardInterrupt):
        experiment_of(bench, recorder, show=stop).run(more)
    recorder.close()
    bench.close()
    assert path.read_bytes() == bytes_before
    assert half_done_plan(path) == more
    bench = bench_of()
    recorder, so_far = Recorder.resumed(path, more)
    assert so_far.frames is not None
    assert len(so_far.frames) == recorder.before == first.frames
    assert recorder.set_apart == tmp_path / "a.press_2_cut_off_1.h5"
    experiment_of(bench, recorder).run(more)
    frames = recorder.finish().frames
    bench.close()
    assert frames is not None
    np.testing.assert_array_equal(frames.voltage_v[: first.frames], finished.frames.voltage_v)
    pressed = frames.history.press[frames.history.touched.any(axis=1)]
    assert list(np.bincount(pressed)) == [sum(step.frames for step in first.presses[0].steps)] * 3
    assert not part_of(path).exists()


def test_presses_half_added_to_another_recording_are_not_mixed_in(tmp_path: Path) -> None:
    path, bench, plan = tmp_path / "a.h5", bench_of(), plan_of_presses(1)
    recorder = recorder_of(bench, plan, path)
    experiment_of(bench, recorder).run(plan)
    finished = recorder.finish()
    bench.close()
    more = replace(plan, first=1)
    Recorder.adding_to(path, finished, more).close()
    assert finished.frames is not None
    other = replace(finished, frames=finished.frames[1:])
    write_recording(path, other, overwrite=True)
    with pytest.raises(RecordingError, match="added to another recording"):
        Recorder.resumed(path, more)
