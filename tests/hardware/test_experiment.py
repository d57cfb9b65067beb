"""The experiment on emulated instruments: what is recorded, what stops it, and that it never stays on the skin."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pytest
from small_experiment import bench_of, deepest_m, experiment_of, plan_of_presses, recorder_of

from ertskin.hardware.experiment import Experiment, Progress, check_plan
from ertskin.hardware.failure import InstrumentError, LimitExceeded, LostContact, NoAnswer
from ertskin.hardware.indenter import Indenter, StillPressing
from ertskin.hardware.instrument import Travel
from ertskin.hardware.plan import Plan, PlanError, Press, ramp, two_point_test
from ertskin.hardware.recorder import part_of
from ertskin.hardware.recording import read_recording
from ertskin.hardware.rigid_block import press_rigid_block
from ertskin.hardware.specimen_run import SpecimenSetup, press_specimen
from ertskin.hardware.validate import validate
from ertskin.hardware.virtual.faults import Faults
from ertskin.hardware.virtual.rig import PLATE_M2
from ertskin.physics.history import Phase


@pytest.mark.parametrize(("stage", "load_cell"), [("grbl", "hx711"), ("marlin", "mark10"), ("grbl", "futek")])
def test_records_what_the_plan_says(stage: str, load_cell: str, tmp_path: Path) -> None:
    bench, plan = bench_of(stage, load_cell), plan_of_presses()
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")
    shown: list[Progress] = []
    outcome = experiment_of(bench, recorder, show=shown.append).run(plan)
    recorder.finish()
    bench.close()
    assert outcome.failed == []
    assert outcome.lost_scans == 0
    frames = read_recording(tmp_path / "a.h5").frames
    assert frames is not None
    assert len(frames) == plan.frames == len(shown)
    history = frames.history
    assert list(history.press[history.phase == Phase.REST]) == [0, 1, 2]
    depth = history.depth_m[:, 0]
    pressed = np.isfinite(depth)
    # Springs of 2 N/mm under a surface found by touch: force tells true depth.
    np.testing.assert_allclose(history.force_n[pressed, 0], 2e3 * depth[pressed], atol=0.03)
    np.testing.assert_allclose(history.force_n[~pressed, 0], 0.0, atol=0.02)
    np.testing.assert_allclose(history.contact_m[pressed, 0], [0.03, 0.03] * np.ones((pressed.sum(), 2)))
    np.testing.assert_array_equal(frames.voltage_v, (frames.adc_count * 2.0**-13).astype(np.float32))
    steps = np.diff(history.time_s[(history.press == 0) & (history.phase == Phase.HOLD)])
    np.testing.assert_allclose(steps, 0.5, atol=0.05)
    findings = validate(tmp_path / "a.h5")
    assert findings.errors == []
    assert findings.number("noise at rest") == pytest.approx(1e-3, rel=0.2)


def test_the_same_seed_records_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.h5", "b.h5"):
        bench, plan = bench_of(), plan_of_presses(1)
        recorder = recorder_of(bench, plan, tmp_path / name)
        experiment_of(bench, recorder).run(plan)
        recorder.finish()
        bench.close()
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_rigid_block_gives_the_supports_stiffness() -> None:
    bench = bench_of(block_stiffness_n_per_m=9e3)
    indenter = Indenter(bench.open())
    indenter.ready()
    indenter.zero()
    block = press_rigid_block(indenter)
    slope, offset = np.polyfit(block.depth_m, block.force_n, 1)
    assert slope == pytest.approx(9e3, rel=0.01)
    assert offset == pytest.approx(0.0, abs=0.02)
    assert deepest_m(bench) < -5e-3
    bench.close()


@pytest.mark.parametrize("higher_m", [-5e-3, 20e-3])
@pytest.mark.parametrize("what", ["block", "specimen"])
def test_who_guards_knows_when_a_block_or_specimen_of_another_height_is_pressed(what: str, higher_m: float) -> None:
    bench = bench_of(block_stiffness_n_per_m=9e3, pair=StraightPair())
    x, y, z = bench.fields["geometry"]["origin_m"]
    bench.fields["geometry"]["origin_m"] = (x, y, z - higher_m)
    lowerings: list[tuple[bool, float]] = []
    indenter = Indenter(bench.open())
    indenter.rig.tell_lowered = lambda lowered: lowerings.append((lowered, deepest_m(bench)))
    indenter.ready()
    indenter.zero()
    lowerings.clear()
    if what == "block":
        press_rigid_block(indenter, depth_m=2e-4)
    else:
        bench.wire_specimen(True)
        press_specimen(indenter, SpecimenSetup(PLATE_M2, steps=2, cycles=1))
    downs = [lowered for lowered, _ in lowerings]
    assert True in downs
    assert lowerings[downs.index(True)][1] < 0.0
    assert not downs[-1]
    assert lowerings[-1][1] < -5e-3
    assert indenter.surface_z_m == pytest.approx(z - higher_m)
    indenter.retract()
    bench.close()


def test_a_block_pressed_too_hard_is_left_upwards_and_the_skins_surface_known_again() -> None:
    bench = bench_of(block_stiffness_n_per_m=9e3)
    x, y, z = bench.fields["geometry"]["origin_m"]
    bench.fields["geometry"]["origin_m"] = (x, y, z - 20e-3)
    bench.fields["limits"]["force_n"] = 1.0
    lowered: list[bool] = []
    indenter = Indenter(bench.open())
    indenter.rig.tell_lowered = lowered.append
    indenter.ready()
    indenter.zero()
    with pytest.raises(LimitExceeded, match="beyond 1 N"):
        press_rigid_block(indenter)
    assert lowered[-1] is False
    assert deepest_m(bench) < -5e-3
    assert indenter.surface_z_m == pytest.approx(z - 20e-3)
    bench.close()


def test_weights_are_asked_for_and_kept_apart(tmp_path: Path) -> None:
    bench = bench_of()
    plan = two_point_test(bench.world.skin.sensor.taxel_m, [(0, 8), (1, 7)])
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")
    asked: list[Press | None] = []
    experiment_of(bench, recorder, place_weights=asked.append).run(plan)
    frames = recorder.finish().frames
    bench.close()
    assert [press is None for press in asked] == [False, True, False, True]
    assert frames is not None
    touched = frames.history.touched
    assert touched.sum() == 4
    np.testing.assert_allclose(frames.history.force_n[touched], 4.903, atol=1e-3)
    assert np.isnan(frames.history.depth_m).all()


# ------------------------------------------------------------------------------------------------------- what stops it


def test_a_plan_beyond_the_limits_never_begins() -> None:
    bench = bench_of()
    rig = bench.open()
    too_deep = Plan("deep", (Press(((0.03, 0.03),), ramp(5e-3, 1e-3)),))
    off_sheet = Plan("off", (Press(((0.09, 0.03),), ramp(1e-3, 1e-3)),))
    two_at_once = Plan("two", (Press(((0.01, 0.03), (0.03, 0.03)), ramp(1e-3, 1e-3)),))
    for plan, what in ((too_deep, "deep"), (off_sheet, "off the sheet"), (two_at_once, "one indenter")):
        with pytest.raises(PlanError, match=what):
            check_plan(plan, rig)
    low, high = rig.stage.travel.low_m, rig.stage.travel.high_m
    rig.stage.travel = Travel((low[0], low[1], rig.geometry.origin_m[2] - 5e-4), high)
    with pytest.raises(PlanError, match="travel"):
        check_plan(plan_of_presses(), rig)
    assert bench.clock.now() == 0.0
    bench.close()


def test_no_move_goes_beyond_a_limit() -> None:
    bench = bench_of()
    rig = bench.open()
    indenter = Indenter(rig)
    indenter.ready()
    indenter.zero()
    with pytest.raises(LimitExceeded, match="depth"):
        indenter.press((0.03, 0.03), rig.limits.depth_m + 1e-4, 1e-3)
    with pytest.raises(LimitExceeded, match="travel"):
        indenter.above((1.0, 0.03))
    assert deepest_m(bench) < 0.0
    bench.close()


def _stopped(tmp_path: Path, error: type[BaseException], **options: object) -> str:
    """Run into ``error``; what it said. The indenter must be in the air and the frames kept."""
    bench, plan = bench_of(**options.pop("bench", {})), plan_of_presses()  # type: ignore[arg-type]
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")
    disturb = options.pop("disturb", None)
    taken: list[Progress] = []

    def show(progress: Progress) -> None:
        taken.append(progress)
        if disturb is not None and progress.depth_m == 1e-3:
            disturb(bench)  # type: ignore[operator]

    experiment = experiment_of(bench, recorder, show=show)
    with pytest.raises(error) as stopped:
        experiment.run(plan)
    recorder.close()
    assert deepest_m(bench) < 0.0
    assert not (tmp_path / "a.h5").exists()
    frames = read_recording(part_of(tmp_path / "a.h5")).frames
    assert frames is not None
    assert len(frames) == len(taken)
    bench.close()
    return str(stopped.value)


def test_force_limit(tmp_path: Path) -> None:
    assert "beyond 1.2 N" in _stopped(tmp_path, LimitExceeded, bench={"limits": {"force_n": 1.2}})


def test_touch_off_that_meets_nothing(tmp_path: Path) -> None:
    assert "met nothing" in _stopped(tmp_path, LimitExceeded, bench={"limits": {"touch_range_m": 1e-3}})


def test_load_in_the_air(tmp_path: Path) -> None:
    def lean(bench: object) -> None:
        bench.load_cell._write = lambda force, _time: f"{round((force + 1.0) * 20_000) + 81_234}"  # type: ignore[attr-defined]

    said = _stopped(tmp_path, LimitExceeded, disturb=lean)
    assert "N in the air" in said


def test_ctrl_c(tmp_path: Path) -> None:
    _stopped(tmp_path, KeyboardInterrupt, disturb=lambda _bench: os.kill(os.getpid(), signal.SIGINT))


def test_an_exception_of_ours(tmp_path: Path) -> None:
    def fail(_bench: object) -> None:
        raise RuntimeError("a bug")

    assert _stopped(tmp_path, RuntimeError, disturb=fail) == "a bug"


@pytest.mark.parametrize("device", ["load_cell", "reader"])
def test_a_cable_pulled_for_good(device: str, tmp_path: Path) -> None:
    said = _stopped(tmp_path, LostContact, disturb=lambda bench: getattr(bench, device).unplug())
    assert "can't be opened" in said or "contact lost" in said


@pytest.mark.parametrize(("device", "expected"), [("load_cell", "no lines of a"), ("reader", "no reader of our link")])
def test_an_instrument_silent_for_good(device: str, expected: str, tmp_path: Path) -> None:
    silence = Faults(0, {"drop": 1.0})
    said = _stopped(
        tmp_path, InstrumentError, disturb=lambda bench: setattr(getattr(bench, device), "outgoing", silence)
    )
    assert expected in said


def test_a_stage_silent_for_good_is_said_aloud(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    bench, plan = bench_of(), plan_of_presses()
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")

    def show(progress: Progress) -> None:
        if progress.depth_m == 1e-3:
            bench.stage.outgoing = Faults(0, {"drop": 1.0})

    with pytest.raises(StillPressing, match=r"raise it by hand: stage .*no answer to a reset"):
        experiment_of(bench, recorder, show=show).run(plan)
    assert "ertskin: the stage may still press, trying to raise it (stage " in capfd.readouterr().err
    recorder.close()
    bench.close()


@pytest.mark.parametrize("stage", ["grbl", "marlin"])
def test_a_stage_silent_from_the_start_is_refused_and_not_said_to_press(
    stage: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bench, plan = bench_of(stage), plan_of_presses()
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")
    bench.stage.outgoing = Faults(0, {"drop": 1.0})
    with pytest.raises(NoAnswer, match="stage"):
        experiment_of(bench, recorder).run(plan)
    assert bench.clock.now() < 8.0
    assert capfd.readouterr().err == ""
    recorder.close()
    bench.close()


def test_the_stages_own_cable_pulled_for_good_is_said_aloud(tmp_path: Path) -> None:
    bench, plan = bench_of(), plan_of_presses()
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")

    def show(progress: Progress) -> None:
        if progress.depth_m == 1e-3:
            bench.stage.unplug()

    with pytest.raises(StillPressing, match="raise it by hand"):
        experiment_of(bench, recorder, show=show).run(plan)
    recorder.close()
    bench.close()


@pytest.mark.parametrize("stage", ["grbl", "marlin"])
@pytest.mark.parametrize("device", ["stage", "load_cell", "reader"])
@pytest.mark.parametrize("trouble", ["unplug", "crash"])
def test_trouble_that_passes_costs_one_press(stage: str, device: str, trouble: str, tmp_path: Path) -> None:
    bench, plan = bench_of(stage), plan_of_presses(3)
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")
    done: list[int] = []

    def show(progress: Progress) -> None:
        if progress.press == 1 and progress.depth_m == 1e-3 and not done:
            done.append(1)
            getattr(bench, device).unplug(3.0) if trouble == "unplug" else getattr(bench, device).crash()

    outcome = experiment_of(bench, recorder, show=show).run(plan)
    frames = recorder.finish().frames
    assert frames is not None
    assert deepest_m(bench) < 0.0
    assert len(outcome.failed) <= 1
    assert outcome.presses + len(outcome.failed) == 3
    whole = frames[frames.history.press == 2]
    assert len(whole) == plan.presses[2].frames
    pressed = np.isfinite(frames.history.depth_m[:, 0])
    np.testing.assert_allclose(frames.history.force_n[pressed, 0], 2e3 * frames.history.depth_m[pressed, 0], atol=0.05)
    bench.close()


def test_three_presses_failing_end_it(tmp_path: Path) -> None:
    bench, plan = bench_of(), plan_of_presses(6)
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")

    def show(progress: Progress) -> None:
        if progress.depth_m == 5e-4:
            bench.reader.unplug(2.0)

    experiment = experiment_of(bench, recorder, show=show)
    with pytest.raises(InstrumentError):
        experiment.run(plan)
    assert len(experiment.outcome.failed) == 3
    assert deepest_m(bench) < 0.0
    recorder.close()
    bench.close()


def test_a_damaged_scan_is_taken_again_not_recorded(tmp_path: Path) -> None:
    bench, plan = bench_of(), plan_of_presses(1)
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")

    def show(_progress: Progress) -> None:
        bench.reader.outgoing.arm("corrupt")

    outcome = experiment_of(bench, recorder, show=show).run(plan)
    frames = recorder.finish().frames
    assert outcome.failed == []
    assert frames is not None
    assert frames.adc_count is not None
    made = list(bench.reader.made)
    assert len(frames) == plan.frames
    for count in frames.adc_count:
        assert any(np.array_equal(count, one) for one in made)
    bench.close()


def test_saturation_is_seen_as_it_happens(tmp_path: Path) -> None:
    bench, plan = bench_of(), plan_of_presses(1)
    bench.reader.gain = 50.0
    recorder = recorder_of(bench, plan, tmp_path / "a.h5")
    outcome = experiment_of(bench, recorder).run(plan)
    recorder.close()
    bench.close()
    assert any("saturated" in warning for warning in outcome.warnings)


def test_the_experiment_takes_its_bench_as_given(tmp_path: Path) -> None:
    """What a driver can't be told: the emulated instruments are opened as any serial port, by name."""
    bench = bench_of()
    assert Path(bench.fields["stage"]["port"]).is_symlink()
    rig = bench.open()
    assert isinstance(rig.stage.identify(), str)
    recorder = recorder_of(bench, plan_of_presses(1), tmp_path / "a.h5")
    assert Experiment(rig, recorder, 0.0).outcome.frames == 0
    recorder.close()
    rig.close()
    bench.close()


class StraightPair:
    """A pair whose resistance falls straight with stress."""

    def resistance_ohm_sq(self, time_s: float, stress_pa: float) -> float:
        return 4000.0 - 0.05 * stress_pa


def test_specimen_gives_the_pairs_law() -> None:
    bench = bench_of(pair=StraightPair())
    indenter = Indenter(bench.open())
    indenter.ready()
    indenter.zero()
    bench.wire_specimen(True)
    specimen = press_specimen(indenter, SpecimenSetup(PLATE_M2, steps=6, cycles=2))
    assert len(specimen.stress_pa) == 2 * 13
    assert list(np.unique(specimen.cycle)) == [0, 1]
    assert specimen.stress_pa.max() == pytest.approx(6e4, rel=0.02)
    np.testing.assert_allclose(specimen.sheet_resistance_ohm_sq, 4000 - 0.05 * specimen.stress_pa, atol=12)
    assert (np.diff(specimen.time_s) > 0).all()
    assert deepest_m(bench) < -5e-3
    bench.close()


def test_a_bench_without_a_specimen_says_so() -> None:
    bench = bench_of()
    indenter = Indenter(bench.open())
    with pytest.raises(LimitExceeded, match="specimen_m"):
        press_specimen(indenter, SpecimenSetup(PLATE_M2))
    bench.close()
