"""A second process that takes the indenter off the skin where the recording one no longer can.

The two share a pipe. On it the recording says when the stage goes down and when it is up again; where it can't raise
the stage itself, it closes the port and hands the stage over. A pipe that breaks while the stage is down means that the
recording was killed, and the system closed its port. So the port has one owner at a time.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from typing import Any

from ertskin.hardware.clock import SystemClock
from ertskin.hardware.failure import InstrumentError
from ertskin.hardware.indenter import StillPressing
from ertskin.hardware.raising import raise_patiently, say
from ertskin.hardware.rig import Rig, open_stage

PATIENCE_S = 600.0
"""How long the second process tries."""
LEAVE_S = 60.0
"""Seconds the second process has to end when all is well; on a busy machine it may hardly have begun."""
SETTLE_S = 0.3
"""The system closes a killed program's pipe and its port one after the other."""
DOWN, UP, HANDED_OVER = b"down\n", b"up\n", b"handed over\n"


class Guardian:
    """The recording's end of the pipe."""

    def __init__(self, stage: Mapping[str, Any], height_m: float, speed_m_s: float) -> None:
        """``stage`` as in a rig's description; it is raised by ``height_m`` at ``speed_m_s``."""
        self.down = False
        self._words = json.dumps({"stage": dict(stage), "height_m": height_m, "speed_m_s": speed_m_s})
        self._process = self._begun()

    def tell(self, down: bool) -> None:
        """Say whether the stage may be down from now on. A second process that was killed is begun anew."""
        if self._process.poll() is not None:
            self._process = self._begun()
        elif down == self.down:
            return
        self.down = down
        self._say(DOWN if down else UP)

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

    def _begun(self) -> subprocess.Popen[bytes]:
        # Out of reach of what stops the recording: the terminal's Ctrl-C and its closing.
        command = [sys.executable, "-m", "ertskin.hardware.guardian", self._words]
        group = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
        return subprocess.Popen(command, bufsize=0, stdin=subprocess.PIPE, start_new_session=True, creationflags=group)

    def _say(self, word: bytes) -> None:
        assert self._process.stdin is not None
        # Killed just now: the next word begins another.
        with suppress(OSError):
            self._process.stdin.write(word)

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
    guardian = Guardian(stage, rig.limits.clearance_m + rig.limits.depth_m, rig.limits.travel_speed_m_s)
    rig.tell_lowered = guardian.tell
    try:
        yield
    except BaseException as error:
        if guardian.down:
            _handed_over(guardian, rig, error)
        raise
    finally:
        guardian.dismiss()


def _handed_over(guardian: Guardian, rig: Rig, error: BaseException) -> None:
    rig.stage.close()
    if not guardian.hand_over():
        raise StillPressing(f"the stage may still press, raise it by hand: {error}") from None
    guardian.down = False
    if isinstance(error, StillPressing):
        raise InstrumentError(f"the stage did not come up for a while; it is up now: {error.__cause__}") from None


def stand_guard(words: str) -> int:
    """Wait until the recording is at its end; where the stage is down then, raise it. Exit status, 0 for a stage up."""
    _hold_out()
    word = [UP, *sys.stdin.buffer][-1]
    if word == UP:
        return 0
    announcement = "raising the stage" if word == HANDED_OVER else "the recording is gone, raising the stage"
    fields, clock = json.loads(words), SystemClock()

    clock.sleep(SETTLE_S)

    def attempt() -> None:
        with closing(open_stage(fields, clock)) as stage:
            stage.recover()
            stage.raise_by(fields["height_m"], fields["speed_m_s"])

    error = raise_patiently(attempt, clock, PATIENCE_S, announcement)
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
