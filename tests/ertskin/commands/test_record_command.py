"""``ertskin record`` and ``ertskin doctor`` as a person uses them, on the virtual bench."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf
from rich.console import Console

from ertskin.bench.hands import Person
from ertskin.bench.plan_choice import chosen_plan
from ertskin.cli import main
from ertskin.configuration import config_dir
from ertskin.data.shards import file_sha256
from ertskin.errors import JobFailed
from ertskin.hardware.recorder import Recorder, part_of
from ertskin.hardware.recording import read_recording, write_recording
from ertskin.hardware.validate import validate
from ertskin.hardware.virtual.bench.sealing import unseal
from ertskin.hardware.virtual.bench.truth import Noise
from ertskin.hardware.virtual.faults import Faults
from ertskin.hardware.virtual.rig import VirtualBench, virtual_bench
from ertskin.hardware.virtual.serving import Server
from ertskin.hardware.virtual.skin import SpringSkin
from ertskin.physics.history import Phase

PRESS = "{contact_m: [0.03, 0.05], rest_s: 1.0, ramp: {depth_m: 1.0e-3, step_m: 5.0e-4, hold_frames: 1}}"


def words(out: Path, presses: int = 1, *more: str) -> list[str]:
    """The command line for a few presses."""
    listed = f"plan.presses=[{','.join([PRESS] * presses)}]"
    rig = [f"rig.sealed={out.parent / 'sealed'}", "rig.specimen_run={steps: 5, cycles: 1}"]
    return ["record", "plan=listed", listed, f"recording={out}", *rig, *more]


MANY = 12
"""Presses, more than a recording is stopped in."""
FRAMES = 7
"""Of each press."""


def test_records_a_plan_into_a_sound_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.h5"
    assert main(words(out, 1, "rig.noise.white_v=1.0e-3")) == 0
    assert str(out) in capsys.readouterr().out.replace("\n", "")
    findings = validate(out)
    assert findings.errors == []
    recording = read_recording(out)
    assert recording.frames is not None
    assert recording.rigid_block is not None
    assert recording.specimen is not None
    depth = recording.frames.history.depth_m[:, 0]
    np.testing.assert_allclose(depth, [np.nan, 0.0, 5e-4, 1e-3, 1e-3, 5e-4, 0.0, np.nan], atol=1e-9)
    truth, _ = unseal(out, tmp_path / "sealed")
    assert "piezo_hysteresis" in truth.effects
    assert truth.noise == Noise(white_v=1e-3)
    before = out.read_bytes()
    assert main(words(out)) == 2
    assert out.read_bytes() == before
    capsys.readouterr()
    assert main(["doctor", f"recording={out}"]) == 0
    assert "piezo_hysteresis" not in capsys.readouterr().out
    assert main(["doctor", f"recording={out}", f"sealed={tmp_path / 'sealed'}"]) == 0
    assert "piezo_hysteresis: {'width': 0." in capsys.readouterr().out
    assert main(["doctor", f"recording={out}", f"sealed={tmp_path / 'elsewhere'}"]) == 2


def asking(recording: Path) -> list[str]:
    """The command line for the press that a diagnosis of this recording asks for."""
    press = {"position_m": [0.05, 0.07], "depth_m": 1e-3, "hold_s": 0.1, "speed_m_per_s": 1e-3, "cycles": 1}
    verdict = {"next_press": {"press": [press]}, "recording_sha256": file_sha256(recording)}
    path = recording.with_name("diagnosis.json")
    path.write_text(json.dumps(verdict))
    return [*(word for word in words(recording) if not word.startswith("plan")), f"plan={path}"]


def test_the_press_a_diagnosis_asks_for_is_added(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.h5"
    assert main(words(out)) == 0
    first, added = read_recording(out), asking(out)
    assert first.frames is not None
    capsys.readouterr()
    assert main([*added, "sensor.size_m=[0.1,0.1]"]) == 2
    assert "so no press can be added to it" in capsys.readouterr().err
    # Cut off before its first frame.
    plan = replace(chosen_plan({"kind": "file", "path": added[-1].removeprefix("plan=")}, first.sensor), first=1)
    Recorder.adding_to(out, first, plan).close()
    assert main(added) == 0
    assert "going on at press 2 of 2" in capsys.readouterr().out
    more = read_recording(out)
    assert more.frames is not None
    assert more.specimen is not None
    history, before = more.frames.history, len(first.frames)
    np.testing.assert_array_equal(more.frames.voltage_v[:before], first.frames.voltage_v)
    assert sorted(set(history.press[history.touched.any(axis=1)])) == [0, 1]
    pressed_m = history.contact_m[before:][history.touched[before:, 0], 0]
    np.testing.assert_allclose(pressed_m, [[0.05, 0.07]] * len(pressed_m))
    assert (np.diff(history.time_s) > 0).all()
    # Once is enough.
    kept = out.read_bytes()
    assert main(added) == 2
    assert "or added to it already" in capsys.readouterr().err
    assert out.read_bytes() == kept


def test_a_press_that_was_added_but_not_tidied_up_after_is_there_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "a.h5"
    assert main(words(out)) == 0
    added = asking(out)
    with monkeypatch.context() as patched:
        patched.setattr("ertskin.hardware.recorder.Recorder.finish", finished_but_killed)
        assert main(added) != 0
    assert part_of(out).exists()
    assert main(added) == 0
    frames = read_recording(out).frames
    assert frames is not None
    assert not part_of(out).exists()
    assert sorted(set(frames.history.press[frames.history.touched.any(axis=1)])) == [0, 1]


def finished_but_killed(recorder: Recorder) -> None:
    """What ``finish`` does up to where it removes what it was made of."""
    recorder.close()
    write_recording(recorder.path, read_recording(part_of(recorder.path), sound=False), overwrite=True)
    raise OSError("killed")


def test_real_presses_and_virtual_ones_stay_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.h5"
    assert main(words(out)) == 0
    write_recording(out, replace(read_recording(out), rig="my bench"), overwrite=True)
    before = out.read_bytes()
    capsys.readouterr()
    assert main(asking(out)) == 2
    assert "found presses of rig 'my bench', expected none of rig 'virtual' among them" in capsys.readouterr().err
    assert out.read_bytes() == before


def test_a_list_of_presses_is_added_to_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, listed = tmp_path / "a.h5", tmp_path / "mine.json"
    assert main(words(out)) == 0
    listed.write_text(json.dumps({"presses": [{"contact_m": [0.03, 0.05], "ramp": {"depth_m": 1e-3, "step_m": 5e-4}}]}))
    before = out.read_bytes()
    capsys.readouterr()
    assert main([*asking(out)[:-1], f"plan={listed}"]) == 2
    assert "nothing was overwritten" in capsys.readouterr().err
    assert out.read_bytes() == before


def test_two_points_under_weights_are_felt(tmp_path: Path) -> None:
    out = tmp_path / "two.h5"
    plan = ["plan=two_point_test", "plan.pairs=[[0,35],[7,28]]"]
    assert main([word for word in words(out) if not word.startswith("plan")] + plan) == 0
    frames = read_recording(out).frames
    assert frames is not None
    np.testing.assert_array_equal(frames.history.phase, [Phase.REST, Phase.HOLD, Phase.HOLD, Phase.REST])
    np.testing.assert_allclose(frames.history.force_n[1:3], 4.903, atol=1e-3)
    change = np.abs(frames.voltage_v - frames.voltage_v[0]).max(axis=(1, 2))
    assert change[[1, 2]].min() > 0.1 > 0.05 > change[3]


def test_nobody_there_to_lay_weights(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO())
    with pytest.raises(JobFailed, match="take the weights off"):
        Person(Console()).place_weights(None)


def test_a_dry_run_moves_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*words(tmp_path / "a.h5", 3), "dry_run=true"]) == 0
    assert list(tmp_path.iterdir()) == []
    assert "3 presses, 22 frames" in capsys.readouterr().out


def test_a_dry_run_refuses_a_plan_that_leaves_the_sheet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "off.yaml").write_text("presses: [{contact_m: [0.5, 0.06], ramp: {depth_m: 0.002, step_m: 0.0005}}]\n")
    assert main(["record", f"plan={tmp_path / 'off.yaml'}", "dry_run=true"]) == 2
    assert capsys.readouterr().err == "ertskin: plan: press 0: (500.0, 60.0) mm lies off the sheet\n"


def test_a_plan_from_a_file_or_a_diagnosis(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = {"position_m": [0.05, 0.07], "depth_m": 3e-3, "hold_s": 1e-1, "speed_m_per_s": 1e-3, "cycles": 2}
    verdict = {
        "next_press": {"reason": "memory or creep", "between": ["piezo_creep", "piezo_hysteresis"], "press": [asked]}
    }
    (tmp_path / "diagnosis.json").write_text(json.dumps(verdict))
    (tmp_path / "content.json").write_text(json.dumps({"next_press": None}))
    (tmp_path / "coarse.yaml").write_text("kind: taxels\nramp: {depth_m: 2e-3, step_m: 1e-3}\n")
    for name, expected in (
        ("diagnosis.json", ("tell piezo_creep from piezo_hysteresis", "1 presses, 32 frames, about")),
        ("coarse.yaml", ("36 presses",)),
    ):
        assert main(["record", f"plan={tmp_path / name}", "dry_run=true"]) == 0
        out = capsys.readouterr().out
        assert all(words in out for words in expected), out
    for name, expected in (("content.json", "no next press"), ("absent.yaml", "absent.yaml")):
        assert main(["record", f"plan={tmp_path / name}", "dry_run=true"]) == 2
        assert expected in capsys.readouterr().err


@pytest.mark.parametrize(
    ("word", "expected"),
    [
        ("plan.kind=unknown", "no kind"),
        ("rig.stage.driver=abacus", "abacus"),
        ("rig.effects={no_such_effect: 1.0}", "no_such_effect"),
        ("rig.noise.landing_m=far", "rig.noise.landing_m must be a number"),
        ("rig.noise.spike_v=-0.1", "rig.noise.spike_v must be at least 0"),
        ("rig.limits.depth_m=1.0e-4", "beyond the limit"),
        ("sensor.electrode_size_m=[1,2,3]", "sensor"),
    ],
)
def test_what_can_not_be_is_reported_in_a_line(
    word: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words(tmp_path / "a.h5", 1, word)) == 2
    error = capsys.readouterr().err.strip()
    assert expected in error
    assert "\n" not in error


def test_the_rigs_file_lists_all_that_can_be_noisy() -> None:
    listed = OmegaConf.load(config_dir() / "rig" / "virtual.yaml")
    assert OmegaConf.to_container(listed.noise) == asdict(Noise())


def test_stopped_then_killed_and_gone_on_with(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.h5"
    stopped = _sent(out, signal.SIGTERM, 1)
    assert stopped.returncode == 128 + signal.SIGTERM
    assert stopped.stderr == ""
    assert "record again to go on" in stopped.stdout
    assert _sent(out, signal.SIGKILL, 2).returncode == -signal.SIGKILL
    before = read_recording(part_of(out)).frames
    assert before is not None
    assert np.bincount(before.history.press)[-1] < FRAMES
    assert main(words(out, MANY)) == 0
    kept = re.search(r"kept in .*a\.press_(\d+)_cut_off_1\.h5", capsys.readouterr().out)
    assert kept is not None
    cut_off = int(kept[1])
    frames = read_recording(out).frames
    assert frames is not None
    whole = np.count_nonzero(before.history.press < cut_off)
    np.testing.assert_array_equal(frames.voltage_v[:whole], before.voltage_v[:whole])
    half = read_recording(tmp_path / f"a.press_{cut_off}_cut_off_1.h5").frames
    assert half is not None
    np.testing.assert_array_equal(half.voltage_v, before.voltage_v[whole:])
    assert (np.diff(frames.history.time_s) > 0).all()
    assert list(np.bincount(frames.history.press)) == [7] * MANY + [1]
    assert not part_of(out).exists()


def _sent(out: Path, number: signal.Signals, press: int) -> subprocess.CompletedProcess[str]:
    """A recording that gets a signal in the press of that number or a later one, before that is whole."""
    command = [sys.executable, "-m", "ertskin.cli", *words(out, MANY)]
    # Who is killed can't tidy up: its folder of ports goes with the test's.
    environment = {**os.environ, "TMPDIR": str(out.parent)}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.02)
        if not part_of(out).exists():
            continue
        # Reading takes longer than a press on the virtual bench, which waits for it.
        process.send_signal(signal.SIGSTOP)
        presses = _pressing(out, press)
        if presses:
            process.send_signal(number)
        process.send_signal(signal.SIGCONT)
        if presses:
            break
    output, wrong = process.communicate(timeout=60)
    return subprocess.CompletedProcess(command, process.returncode, output, wrong)


def _pressing(out: Path, press: int) -> bool:
    """Whether a recording under way is in the press of that number or a later one, with frames loading and to come."""
    try:
        frames = read_recording(part_of(out)).frames
    except ValueError:
        return False
    if frames is None or not len(frames.history.press) or frames.history.press[-1] < press:
        return False
    last = frames.history.press == frames.history.press[-1]
    return bool((frames.history.phase[last] == Phase.LOADING).any() and np.count_nonzero(last) < FRAMES)


def test_the_rig_is_asked(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "rig=virtual"]) == 0
    output = capsys.readouterr().out
    for word in ("GRBL 1.1h", "HX711", "virtual ERT reader"):
        assert word in output


def test_a_rig_that_is_not_there(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "rig=grbl_hx711", "rig.stage.port=/nowhere"]) == 1
    output = capsys.readouterr()
    assert "stage: /nowhere: can't be opened" in output.out
    assert "no answer from stage, load cell, ERT reader" in output.err


@pytest.fixture
def desk() -> Iterator[tuple[VirtualBench, list[str]]]:
    """A bench on a desk, as far as the command can tell: instruments in real time, and the words that name them."""
    skin = SpringSkin(1, electrodes=24)
    bench = virtual_bench(skin, real_time=True, limits={"travel_speed_m_s": 0.3})
    bench.stage.homing_m_s = 1.0
    server = Server([bench.stage, bench.load_cell, bench.reader])
    groups = {"stage", "load_cell", "ert_reader", "geometry", "limits"}
    yield bench, [f"rig.{name}={json.dumps(bench.fields[name]).replace(chr(34), '')}" for name in groups]
    server.close()
    bench.close()


def test_a_stage_silent_from_the_start_is_refused_within_seconds(
    desk: tuple[VirtualBench, list[str]], tmp_path: Path
) -> None:
    bench, rig = desk
    bench.stage.outgoing = Faults(0, {"drop": 1.0})
    begun = time.monotonic()
    command = [sys.executable, "-m", "ertskin.cli", *words(tmp_path / "a.h5")[:4], "rig=grbl_hx711", *rig]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
    # The stage is waited for four seconds; the rest is the program's start, on a machine that may be busy.
    assert time.monotonic() - begun < 15.0
    assert ended.returncode == 1
    assert ended.stderr.startswith("ertskin: stage ")
    assert ended.stderr.count("\n") == 1
    assert "press" not in ended.stderr


def test_hung_while_it_presses_and_gone_on_with(desk: tuple[VirtualBench, list[str]], tmp_path: Path) -> None:
    bench, rig = desk
    out = tmp_path / "a.h5"
    limits = "rig.limits={travel_speed_m_s: 0.3, approach_m: 1.0e-4, touch_speed_m_s: 5.0e-3, hang_s: 5.0}"
    settings = ["rig=grbl_hx711", *(word for word in rig if not word.startswith("rig.limits")), limits]
    ramp = "{depth_m: 1.0e-3, step_m: 1.0e-3, hold_frames: 6}"
    plan = ["plan=listed", f"plan.presses=[{{contact_m: [0.03, 0.05], rest_s: 0.1, speed_m_s: 5.0e-3, ramp: {ramp}}}]"]
    command = [sys.executable, "-m", "ertskin.cli", "record", *plan, f"recording={out}", *settings]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60.0
    while bench.world.depth_m(bench.clock.now()) < 8e-4:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(signal.SIGSTOP)
    said = process.communicate(timeout=90.0)[1]
    assert process.returncode in (128 + signal.SIGTERM, -signal.SIGKILL)
    assert "ertskin: the recording hangs (no sign of life for 5 s while the stage may press)" in said
    assert said.endswith("the stage is up\n")
    assert bench.world.depth_m(bench.clock.now()) < 0.0
    gone_on = subprocess.run(command, capture_output=True, text=True, timeout=90.0)
    assert gone_on.returncode == 0, gone_on.stderr
    assert "going on at press 1 of 1" in gone_on.stdout
    assert (tmp_path / "a.press_0_cut_off_1.h5").exists()
    frames = read_recording(out).frames
    assert frames is not None
    assert list(np.bincount(frames.history.press)) == [10, 1]


def test_a_stage_that_refuses_while_it_presses_costs_one_press(
    desk: tuple[VirtualBench, list[str]], tmp_path: Path
) -> None:
    bench, rig = desk
    command = [sys.executable, "-m", "ertskin.cli", *words(tmp_path / "a.h5")[:4], "rig=grbl_hx711", *rig]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60.0
    while bench.world.depth_m(bench.clock.now()) < 8e-4:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    bench.stage.only_say(b"error:9\r\n", 5.0)
    out, error = process.communicate(timeout=90.0)
    assert process.returncode == 0, error
    assert bench.world.depth_m(bench.clock.now()) < 0.0
    assert "the stage may still press" in error
    assert error.endswith("ertskin: the stage is up\n")
    assert "0 presses" in out
    assert "given up press 0: stage " in out
