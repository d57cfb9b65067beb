"""A stage in trouble while it presses, a recording killed or hung: it comes off the skin. Real time and processes."""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import psutil
import pytest
from small_experiment import bench_of

from ertskin.hardware.guardian import DOWN, HUNG, UP, Guardian, last_word
from ertskin.hardware.recorder import part_of
from ertskin.hardware.recording import read_recording
from ertskin.hardware.virtual.faults import Faults
from ertskin.hardware.virtual.rig import VirtualBench
from ertskin.hardware.virtual.serving import Server

SCRIPT = Path(__file__).with_name("guarded_recording.py")
PRESSED_M = 6e-4
REFUSALS = {"grbl": b"error:9\r\n", "marlin": b"Error:Printer halted. kill() called!\r\n"}
WARNING = "may still press"
HANG_S = 5.0


@dataclass
class Session:
    """A recording in a process of its own, on a bench that is served here."""

    bench: VirtualBench
    process: subprocess.Popen[bytes]
    out: Path

    @property
    def said(self) -> str:
        """What the recording and its guardian have said."""
        return self.out.with_suffix(".said").read_text()

    def until_pressing(self) -> None:
        """Return once the indenter is deep in the skin."""
        self.seconds_until(lambda: self.depth_m > PRESSED_M, 60.0)

    @property
    def depth_m(self) -> float:
        """How deep the indenter is; negative in the air."""
        return self.bench.world.depth_m(self.bench.clock.now())

    def seconds_until(self, true: Callable[[], bool], most_s: float) -> float:
        """How long that takes; fails after ``most_s``."""
        begin = time.monotonic()
        while not true():
            assert time.monotonic() - begin < most_s, self.said
            time.sleep(0.02)
        return time.monotonic() - begin

    def guardians(self) -> list[int]:
        """Process numbers of those who guard."""
        mine = self.bench.fields["stage"]["port"]
        words = {process.pid: process.info["cmdline"] or [] for process in psutil.process_iter(["cmdline"])}
        return [pid for pid, line in words.items() if "ertskin.hardware.guardian" in line and mine in line[-1]]


@pytest.fixture
def begin(tmp_path: Path) -> Iterator[Callable[..., Session]]:
    """Begins a recording: on which stage, what happens to the bench before, seconds the recording has to retract and
    may go without a sign of life, and the way in which it hangs."""
    numbers = count()
    with ExitStack() as stack:

        def begun(
            stage: str = "grbl",
            before: Callable[[VirtualBench], Any] = lambda _bench: None,
            retract_s: float = 60.0,
            hang_s: float = 60.0,
            way: str = "",
        ) -> Session:
            limits = {"travel_speed_m_s": 0.3, "clearance_m": 0.005, "hang_s": hang_s}
            bench = bench_of(stage, real_time=True, limits=limits)
            stack.callback(bench.close)
            bench.stage.homing_m_s = 1.0
            before(bench)
            stack.callback(Server([bench.stage, bench.load_cell, bench.reader]).close)
            out = tmp_path / f"{next(numbers)}.h5"
            command = [sys.executable, str(SCRIPT), str(out), json.dumps(bench.fields), str(retract_s), way]
            said = stack.enter_context(out.with_suffix(".said").open("w"))
            session = Session(bench, subprocess.Popen(command, stderr=said), out)
            stack.callback(lambda: session.seconds_until(lambda: not session.guardians(), 30.0))
            stack.callback(session.process.wait)
            stack.callback(session.process.kill)
            return session

        yield begun


def test_killed_while_pressing(begin: Callable[..., Session]) -> None:
    session = begin()
    session.until_pressing()
    session.process.kill()
    session.seconds_until(lambda: not session.guardians(), 20.0)
    assert session.depth_m < 0.0
    assert session.said.endswith("raising the stage\nertskin: the stage is up\n")
    frames = read_recording(part_of(session.out)).frames
    assert frames is not None
    assert len(frames) >= 4


def test_a_stage_that_refuses_for_ten_seconds_is_raised_and_the_plan_goes_on(begin: Callable[..., Session]) -> None:
    # Twice as long as a recording may go without a sign of life: one that is busy with its stage doesn't hang.
    sessions = {stage: begin(stage, hang_s=HANG_S) for stage in REFUSALS}
    for stage, session in sessions.items():
        session.until_pressing()
        session.bench.stage.only_say(REFUSALS[stage], 10.0)
    for session in sessions.values():
        session.seconds_until(lambda session=session: session.depth_m < 0.0, 25.0)
        assert session.said.count(WARNING) >= 3
        session.until_pressing()
        assert session.said.endswith("ertskin: the stage is up\n")
        session.process.send_signal(signal.SIGTERM)
        assert session.process.wait(20.0) == 128 + signal.SIGTERM
        assert session.depth_m < 0.0
        assert "hangs" not in session.said


def test_who_hangs_is_ended_and_who_sleeps_is_not(begin: Callable[..., Session]) -> None:
    stopped, deadlocked = hung = [begin(hang_s=HANG_S, way=way) for way in ("stop", "deadlock")]
    asleep = begin(hang_s=HANG_S)
    asleep.until_pressing()
    both = [asleep.process.pid, *asleep.guardians()]
    for pid in both:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(HANG_S + 1.0)
    for pid in both:
        os.kill(pid, signal.SIGCONT)
    for session in hung:
        session.seconds_until(lambda session=session: not session.guardians(), 90.0)
        assert session.depth_m < 0.0, session.said
        assert "hangs (no sign of life for 5 s while the stage may press), asking it to end\n" in session.said
        assert session.said.endswith("the stage is up\n")
        frames = read_recording(part_of(session.out)).frames
        assert frames is not None
        assert len(frames) >= 4
    # On a busy machine the one that was stopped may not raise the stage in time and be killed like the other.
    assert stopped.process.wait(30.0) in (128 + signal.SIGTERM, -signal.SIGKILL)
    assert deadlocked.process.wait(30.0) == -signal.SIGKILL
    assert "killing it and raising the stage\n" in deadlocked.said
    asleep.seconds_until(lambda: asleep.depth_m < 0.0, 60.0)
    asleep.until_pressing()
    assert asleep.process.poll() is None
    assert "hangs" not in asleep.said


def test_silence_counts_while_the_stage_is_down_alone_and_any_word_ends_it() -> None:
    asked: list[int] = []
    minute = [None] * 60
    for words, expected, times in (
        ([UP, *minute * 3, b""], UP, 0),
        ([DOWN, *minute[1:], DOWN, *minute[1:], b""], DOWN, 0),
        ([DOWN, *minute, UP, b""], UP, 1),
        ([DOWN, *minute, DOWN, *minute[1:], UP, *minute, b""], UP, 1),
        ([DOWN, *minute, *[None] * 4, b""], DOWN, 1),
        ([DOWN, *minute, *[None] * 5], HUNG, 1),
    ):
        asked.clear()
        assert last_word(Recited(words), 60.0, lambda: asked.append(1)) == expected
        assert len(asked) == times


class Recited(queue.Queue[bytes]):
    """Words of a recording one by one; None is a wait in which none came."""

    def __init__(self, words: list[bytes | None]) -> None:
        super().__init__()
        self._words = iter(words)

    def get(self, block: bool = True, timeout: float | None = None) -> bytes:
        word = next(self._words)
        if word is None:
            raise queue.Empty
        return word


def test_a_guardian_that_no_longer_reads_holds_up_nobody_and_is_replaced(tmp_path: Path) -> None:
    stage = {"driver": "grbl", "port": str(tmp_path / "none"), "travel_low_m": [0, 0, 0], "travel_high_m": [1, 1, 1]}
    guardian = Guardian(stage, 0.01, 0.02, 60.0)
    first = guardian._process
    first.send_signal(signal.SIGSTOP)
    # More than any pipe takes.
    for number in range(1 << 18):
        guardian.tell(number % 2 == 0)
        if guardian._process is not first:
            break
    assert first.wait(10.0) == -signal.SIGKILL
    guardian.tell(True)
    guardian.tell(False)
    guardian.dismiss()
    assert guardian._process is not first
    assert guardian._process.wait(60.0) == 0


def test_killed_with_a_stage_that_needs_twelve_seconds_to_answer_a_reset(begin: Callable[..., Session]) -> None:
    session = begin()
    session.until_pressing()
    session.bench.stage.reset_s = 12.0
    session.process.kill()
    session.seconds_until(lambda: not session.guardians(), 30.0)
    assert session.depth_m < 0.0
    assert session.said.count(WARNING) >= 3


def test_ended_while_the_stage_refuses(begin: Callable[..., Session]) -> None:
    signals = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGKILL]
    sessions = {number: begin() for number in signals}
    for session in sessions.values():
        session.until_pressing()
        session.bench.stage.only_say(REFUSALS["grbl"], 8.0)
    for number, session in sessions.items():
        session.seconds_until(lambda session=session: WARNING in session.said, 45.0)
        assert session.depth_m > 0.0
        session.process.send_signal(number)
    for number, session in sessions.items():
        assert session.process.wait(60.0) in (-number, 128 + number)
        session.seconds_until(lambda session=session: not session.guardians(), 60.0)
        assert session.depth_m < 0.0, session.said


def test_a_recording_that_can_not_raise_the_stage_hands_it_over(begin: Callable[..., Session]) -> None:
    session = begin(retract_s=2.0)
    session.until_pressing()
    session.bench.stage.only_say(REFUSALS["grbl"], 9.0)
    assert session.process.wait(30.0) == 1
    assert session.depth_m < 0.0
    assert "ertskin: raising the stage\n" in session.said
    assert "it is up now" in session.said.splitlines()[-1]
    assert "lock" not in session.said
    assert session.said.count(WARNING) >= 3


def test_a_guardian_that_was_killed_is_replaced(begin: Callable[..., Session]) -> None:
    session = begin()
    session.until_pressing()
    (first,) = session.guardians()
    psutil.Process(first).kill()
    session.seconds_until(lambda: session.guardians() not in ([], [first]), 20.0)
    session.until_pressing()
    session.process.kill()
    session.seconds_until(lambda: not session.guardians(), 20.0)
    assert session.depth_m < 0.0


@pytest.mark.parametrize(("down", "said"), [(False, b"down\n"), (True, b"")], ids=["said", "known when it began"])
def test_a_terminal_that_is_closed_silences_the_guardian_and_no_more(down: bool, said: bytes) -> None:
    with ExitStack() as stack:
        bench = bench_of(real_time=True, limits={"travel_speed_m_s": 0.3, "clearance_m": 0.005})
        stack.callback(bench.close)
        stack.callback(Server([bench.stage, bench.load_cell, bench.reader]).close)
        words = {"stage": bench.fields["stage"], "height_m": 0.01, "speed_m_s": 0.02}
        words |= {"process": os.getpid(), "hang_s": 60.0, "down": down}
        command = [sys.executable, "-m", "ertskin.hardware.guardian", json.dumps(words)]
        guardian = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
        assert guardian.stdin is not None
        assert guardian.stderr is not None
        guardian.stderr.close()
        guardian.stdin.write(said)
        guardian.stdin.close()
        assert guardian.wait(60.0) == 0
        assert bench.stage.axes.end_m[2] == 0.0


def test_a_stage_silent_from_the_start_is_refused_in_time(begin: Callable[..., Session]) -> None:
    session = begin(before=_silenced)
    begun = time.monotonic()
    assert session.process.wait(30.0) == 1
    assert time.monotonic() - begun < 10.0
    assert "no answer to a reset" in session.said.splitlines()[-1]
    assert WARNING not in session.said


def _silenced(bench: VirtualBench) -> None:
    bench.stage.outgoing = Faults(0, {"drop": 1.0})
