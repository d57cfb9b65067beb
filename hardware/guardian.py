"""A second process that takes the indenter off the skin where the recording one no longer can.

The two share a pipe. On it the recording says when the stage goes down and when it is up again; where it can't raise
the stage itself, it closes the port and hands the stage over. A pipe that breaks while the stage is down means that the
recording was killed, and the system closed its port.

While the stage is down the recording says so again every second: its own thread does, whenever it looks at the clock or
waits on it, as every wait for an instrument does, however long, and every attempt made again. A recording that hangs,
stopped, deadlocked or held in a call of the system, says nothing and keeps the port. It is asked to end (SIGTERM), then
killed, and only when it is gone is the port opened. So the port has one owner at a time.
"""

from __future__ import annotations

import io
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from typing import Any

from ertskin.hardware.clock import SIGN_S, Clock, SystemClock, unheard
from ertskin.hardware.failure import InstrumentError, NoAnswer
from ertskin.hardware.indenter import StillPressing
from ertskin.hardware.raising import raise_patiently, say
from ertskin.hardware.rig import Rig, open_stage

PATIENCE_S = 600.0
"""How long the second process tries."""
LEAVE_S = 60.0
"""Seconds the second process has to end when all is well; on a busy machine it may hardly have begun."""
SETTLE_S = 0.3
"""The system closes a killed program's pipe and its port one after the other."""
ASKED_S = 5.0
"""How long a recording that hangs and was asked to end may go without a sign of life."""
KILLED_S = 3.0
"""How long a killed recording is waited for; one that the system holds in a call ends only when that does."""
DOWN, UP, HANDED_OVER = b"down\n", b"up\n", b"handed over\n"
HUNG = b"hung\n"
"""Never said: what a recording comes to that says no more."""
ANNOUNCED = {
    HANDED_OVER: "raising the stage",
    DOWN: "the recording is gone, raising the stage",
    HUNG: "the recording does not end, killing it and raising the stage",
}
POSIX = os.name == "posix"


class Guardian:
    """The recording's end of the pipe."""

    def __init__(self, stage: Mapping[str, Any], height_m: float, speed_m_s: float, hang_s: float) -> None:
        """``stage`` as in a rig's description; it is raised by ``height_m`` at ``speed_m_s``.

        After ``hang_s`` without a sign of life of the thread that makes this, the stage down, the recording is ended.
        """
        self.down = False
        self._thread = threading.get_ident()
        self._said_s = 0.0
        fields = {"stage": dict(stage), "height_m": height_m, "speed_m_s": speed_m_s}
        self._fields = fields | {"process": os.getpid(), "hang_s": hang_s}
        self._process = self._begun(self.down)

    def tell(self, down: bool) -> None:
        """Say whether the stage may be down from now on. A second process that was killed is begun anew."""
        if self._process.poll() is not None:
            self._process = self._begun(down)
        elif down == self.down:
            return
        self.down = down
        self._say(DOWN if down else UP)

    def sign_of_life(self) -> None:
        """The recording goes on: said every second while the stage is down. Only its own thread's signs count."""
        if not self.down or time.monotonic() < self._said_s + SIGN_S or threading.get_ident() != self._thread:
            return
        if self._process.poll() is not None:
            # A machine that can't begin another just now must not keep the stage from being raised.
            with suppress(OSError):
                self._process = self._begun(self.down)
        self._say(DOWN)

    def hand_over(self) -> bool:
        """Have the other process raise the stage, whose port must be closed; whether it came up."""
        self.tell(True)
        self._say(HANDED_OVER)
        self._close()
        return self._process.wait() == 0

    def dismiss(self) -> None:
        """All is well, or somebody else's business: let the other process end."""
        self._close()
        if not self.down:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(LEAVE_S)

    def _begun(self, down: bool) -> subprocess.Popen[bytes]:
        # It knows from its first moment where the stage is: what begins it may be killed before the pipe says so.
        words = json.dumps(self._fields | {"down": down})
        # Out of reach of what stops the recording: the terminal's Ctrl-C and its closing.
        command = [sys.executable, "-m", "ertskin.hardware.guardian", words]
        group = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
        process = subprocess.Popen(
            command, bufsize=0, stdin=subprocess.PIPE, start_new_session=True, creationflags=group
        )
        assert process.stdin is not None
        # Who guards and hangs must not hold up the recording.
        if POSIX:
            os.set_blocking(process.stdin.fileno(), False)
        return process

    def _say(self, word: bytes) -> None:
        assert self._process.stdin is not None
        self._said_s = time.monotonic()
        # Killed just now: the next word begins another.
        with suppress(OSError):
            # A full pipe takes nothing: who reads no more guards no more.
            if not self._process.stdin.write(word):
                self._process.kill()

    def _close(self) -> None:
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.close()


@contextmanager
def guarded(rig: Rig, stage: Mapping[str, Any]) -> Iterator[None]:
    """Guard the rig's stage, described in ``stage``, while the block runs and until it is off the skin.

    A block that ends, however, with the indenter still down has it raised by the second process, and waits for that.
    Raises ``StillPressing`` where that fails, and in place of it ``InstrumentError`` where it succeeds.
    """
    limits = rig.limits
    guardian = Guardian(stage, limits.clearance_m + limits.depth_m, limits.travel_speed_m_s, limits.hang_s)
    rig.tell_lowered = guardian.tell
    rig.clock.sign_of_life = guardian.sign_of_life
    try:
        yield
    except BaseException as error:
        if guardian.down:
            _handed_over(guardian, rig, error)
        raise
    finally:
        rig.clock.sign_of_life = unheard
        guardian.dismiss()


def _handed_over(guardian: Guardian, rig: Rig, error: BaseException) -> None:
    rig.stage.close()
    if not guardian.hand_over():
        raise StillPressing(f"the stage may still press, raise it by hand: {error}") from None
    guardian.down = False
    if isinstance(error, StillPressing):
        raise InstrumentError(f"the stage did not come up for a while; it is up now: {error.__cause__}") from None


class _Recording:
    """The guardian's end of the pipe, and the process behind it."""

    def __init__(self, process: int, hang_s: float) -> None:
        self.heard: queue.Queue[bytes] = queue.Queue()
        self.asked = False
        self._process = process
        self._hang_s = hang_s
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def ask_to_end(self) -> None:
        """Have it unwind; one that was stopped is set going for that."""
        silent = f"no sign of life for {self._hang_s:g} s while the stage may press"
        say(f"the recording hangs ({silent}), asking it to end")
        self.asked = True
        self._send("SIGTERM", "SIGCONT")

    def kill(self, clock: Clock) -> None:
        """Returns once it is gone, and its port closed; raises ``NoAnswer`` where it isn't yet."""
        # Where there is no SIGKILL, SIGTERM can't be withstood.
        self._send("SIGKILL" if POSIX else "SIGTERM")
        deadline = clock.now() + KILLED_S
        while not self._gone():
            if clock.now() > deadline:
                raise NoAnswer(f"process {self._process} hangs, can't be killed and still holds the port")
            clock.sleep(0.1)
        clock.sleep(SETTLE_S)

    def _listen(self) -> None:
        with io.FileIO(0, closefd=False) as pipe:
            for word in iter(pipe.readline, b""):
                self.heard.put(word)
        self.heard.put(b"")

    def _gone(self) -> bool:
        # Its number may be another's by then; a process that ended is nobody's parent.
        return not self._listener.is_alive() or (POSIX and os.getppid() != self._process)

    def _send(self, *signals: str) -> None:
        for name in signals:
            if hasattr(signal, name) and not self._gone():
                with suppress(OSError):
                    os.kill(self._process, getattr(signal, name))


def last_word(heard: queue.Queue[bytes], hang_s: float, ask_to_end: Callable[[], None], word: bytes = UP) -> bytes:
    """The last word of a recording that closed its pipe, which ends what is ``heard`` with an empty one; or ``HUNG``.

    ``word`` is what was known before it said any.

    Silence is measured in waits of one second in which nothing came, not by a clock: while the machine sleeps, or this
    process is stopped, none is counted, whatever the clock says afterwards.
    """
    left_s, asked = hang_s, False
    while True:
        if left_s <= 0.0:
            if asked:
                return HUNG
            ask_to_end()
            left_s, asked = ASKED_S, True
        try:
            said = heard.get(timeout=SIGN_S)
        except queue.Empty:
            left_s -= SIGN_S if word == DOWN else 0.0
            continue
        if not said:
            return word
        word, left_s = said, hang_s


def stand_guard(words: str) -> int:
    """Wait until the recording is at its end; where the stage is down then, raise it. Exit status, 0 for a stage up."""
    _hold_out()
    fields, clock = json.loads(words), SystemClock()
    recording = _Recording(fields["process"], fields["hang_s"])
    word = last_word(recording.heard, fields["hang_s"], recording.ask_to_end, DOWN if fields["down"] else UP)
    if word == UP:
        if recording.asked:
            say("the recording has ended, the stage is up")
        return 0

    clock.sleep(SETTLE_S)

    def attempt() -> None:
        if word == HUNG:
            recording.kill(clock)
        with closing(open_stage(fields, clock)) as stage:
            stage.recover()
            stage.raise_by(fields["height_m"], fields["speed_m_s"])

    error = raise_patiently(attempt, clock, PATIENCE_S, ANNOUNCED[word])
    if error is not None:
        say(f"the stage may still press, raise it by hand: {error}")
    return 0 if error is None else 1


def _hold_out() -> None:
    """Whoever ends all that runs here must not end what raises the stage: it ends by itself."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


if __name__ == "__main__":
    sys.exit(stand_guard(sys.argv[1]))
