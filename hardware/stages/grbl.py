"""A stage on a GRBL 1.1 controller.

Protocol: gnea/grbl, doc/markdown/interface.md (v1.1). Lines end in a line feed and are answered by ``ok`` or
``error:N``; ``ALARM:N``, ``[...]`` and ``<...>`` come unasked. The real-time bytes ``?`` (status, at most 5 Hz), ``!``
(feed hold) and 0x18 (soft reset) go past the 128-byte buffer, which never holds more than one line of ours.
"""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass

import numpy as np

from ertskin.hardware.failure import NoAnswer, Refusal
from ertskin.hardware.instrument import Array, Travel
from ertskin.hardware.stages.gcode import ANSWER_S, MOST_LINES, GcodeStage, millimetres
from ertskin.hardware.transport import RECONNECT_S, Lines, Transport

BUFFER_BYTES = 128
STATUS_PERIOD_S = 0.2
WAKE_S = 2.0
"""How long a controller may take to say who it is, and once more to restart, before it is given up."""
AWAKE_S = 1.0
"""A controller that runs answers a status request within this time."""
IDENTIFY_ATTEMPTS = 3
RESET_S = (3.0, 6.0, 15.0)
"""How long the banner is waited for after a reset, before the next one: a board that needs long must not be begun anew
again and again."""
TOLERANCE_M = 15e-6
STATES = frozenset({"Idle", "Run", "Hold", "Jog", "Alarm", "Door", "Check", "Home", "Sleep"})
_NUMBER = r"-?\d{1,6}(?:\.\d{1,4})?"
_TRIPLE = re.compile(rf"({_NUMBER}),({_NUMBER}),({_NUMBER})(?:,{_NUMBER})*", re.ASCII)


@dataclass(frozen=True, eq=False)
class Status:
    """A real-time report: machine state, and the position (3,) in metres as the machine or the work frame has it."""

    state: str
    machine_m: Array | None
    work_m: Array | None
    offset_m: Array | None


def parse_status(line: str) -> Status | None:
    """The report in ``<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:...>``, or None where the line is no whole report."""
    if not (line.startswith("<") and line.endswith(">")):
        return None
    state, *fields = line[1:-1].split("|")
    state = state.split(":")[0]
    if state not in STATES or not fields:
        return None
    found: dict[str, Array] = {}
    for field in fields:
        name, _, value = field.partition(":")
        if name in ("MPos", "WPos", "WCO"):
            match = _TRIPLE.fullmatch(value)
            if match is None:
                return None
            found[name] = 1e-3 * np.array([float(number) for number in match.groups()])
    if "MPos" not in found and "WPos" not in found:
        return None
    return Status(state, found.get("MPos"), found.get("WPos"), found.get("WCO"))


class _Restarted(Refusal):
    """The controller's banner came unasked."""


class Grbl(GcodeStage):
    """A stage on a GRBL 1.1 controller, driven in machine coordinates."""

    modes = ("G21 G90 G94",)
    # A dwell of next to nothing is answered when the planner is empty.
    drain = "G4 P0.01"

    def __init__(self, transport: Transport, travel: Travel) -> None:
        """``travel``: the box in machine coordinates; GRBL's own are negative after homing to the upper ends."""
        super().__init__(transport, travel, "$H")
        self._idle_elsewhere = 0
        self._offset_m: Array | None = None
        self._last_status_s = -np.inf

    # ------------------------------------------------------------------------------------------------ the interface

    def identify(self) -> str:
        """GRBL's version. Many boards restart when their port is opened, and are asked again once they have.

        Raises ``NoAnswer`` after four seconds without any.
        """
        for _ in range(IDENTIFY_ATTEMPTS - 1):
            self._lines.discard()
            try:
                return self._version()
            except _Restarted:
                continue
            except NoAnswer:
                # One that a limit switch stopped takes nothing but a reset.
                self._reset((WAKE_S,))
        return self._version()

    def position_m(self) -> Array:
        """(3,) machine position."""
        for _ in range(40):
            place = self._place_m(self._status())
            if place is not None:
                return place
        raise NoAnswer(f"{self._name}: reports work positions without ever telling their offset")

    def moving(self) -> bool:
        """Whether the last move is still under way."""
        status = self._status()
        if status.state in ("Alarm", "Door", "Sleep"):
            self.trusted = False
            raise Refusal(f"{self._name}: stopped, state {status.state}")
        if status.state != "Idle" or self._target_m is None:
            return status.state in ("Run", "Hold", "Jog", "Home")
        place = self._place_m(status)
        place = self.position_m() if place is None else place
        if np.abs(place - self._target_m).max() <= TOLERANCE_M:
            self._arrived_m = place
            return False
        # Just after its ok a move may not have begun.
        self._idle_elsewhere += 1
        if self._idle_elsewhere > 3:
            raise Refusal(f"{self._name}: stands still away from {millimetres(self._target_m)} mm")
        return True

    def halt(self) -> None:
        """Feed hold; returns once it stands, so that a reset leaves its position known."""
        self._transport.write(b"!")
        deadline = self._clock.now() + ANSWER_S
        while self._status().state in ("Run", "Jog", "Home") and self._clock.now() < deadline:
            pass

    def recover(self) -> None:
        """Reopen the port if it must be, soft reset, unlock."""
        if self._transport.restore(RECONNECT_S):
            self.trusted = False
            self._lines = Lines(self._transport)
        self._reset()
        self._command("$X")
        self._set_modes()

    def raise_by(self, height_m: float, speed_m_s: float) -> None:
        """Straight up, relative to wherever the stage is.

        Where the position is lost, GRBL may take the present place for the top of its travel and refuse to rise:
        homing, which lifts z first, is then the way up, and a relative move only where homing is off.
        """
        if self.trusted or not self._homed():
            super().raise_by(height_m, speed_m_s)

    # ------------------------------------------------------------------------------------------------- the protocol

    def _command(self, line: str, timeout_s: float = ANSWER_S) -> list[str]:
        """Send one line and return what came before its ``ok``."""
        data = line.encode("ascii") + b"\n"
        assert len(data) <= BUFFER_BYTES
        self._transport.write(data)
        deadline = self._clock.now() + timeout_s
        before: deque[str] = deque(maxlen=MOST_LINES)
        while True:
            answer = self._lines.next(deadline - self._clock.now())
            if answer is None:
                raise NoAnswer(f"{self._name}: no ok to {line!r} within {timeout_s:g} s")
            if answer == "ok":
                return list(before)
            self._raise_if_stopped(answer, line)
            before.append(answer)

    def _begin(self, line: str, seconds: float) -> None:
        self._idle_elsewhere = 0
        self._command(f"G53 {line}")

    def _raise_if_stopped(self, answer: str, line: str) -> None:
        if re.fullmatch(r"error:\d{1,3}", answer):
            raise Refusal(f"{self._name}: {answer} to {line!r}")
        if re.fullmatch(r"ALARM:\d{1,3}", answer):
            self.trusted = False
            raise Refusal(f"{self._name}: {answer}")
        if answer.startswith("Grbl "):
            self.trusted = False
            raise _Restarted(f"{self._name}: was reset, its position is lost")

    def _status(self) -> Status:
        """A status report, asked for at most five times a second and again where one is lost or damaged."""
        for _ in range(4):
            self._clock.sleep(self._last_status_s + STATUS_PERIOD_S - self._clock.now())
            self._last_status_s = self._clock.now()
            self._transport.write(b"?")
            deadline = self._clock.now() + 0.5
            while (line := self._lines.next(deadline - self._clock.now())) is not None:
                status = parse_status(line)
                if status is not None:
                    return status
                self._raise_if_stopped(line, "?")
        raise NoAnswer(f"{self._name}: no status report")

    def _version(self) -> str:
        for line in self._command("$I", WAKE_S):
            if line.startswith("[VER:1.1"):
                return f"GRBL {line[5:].strip(':]')}"
        raise Refusal(f"{self._name}: is no GRBL 1.1")

    def _place_m(self, status: Status) -> Array | None:
        """(3,) the machine position a report tells, None where it is a work position of unknown offset."""
        if status.offset_m is not None:
            self._offset_m = status.offset_m
        if status.machine_m is not None or status.work_m is None or self._offset_m is None:
            return status.machine_m
        return status.work_m + self._offset_m

    def _homed(self) -> bool:
        try:
            self.home()
        except Refusal as refusal:
            if "error:5 " in str(refusal):
                return False
            raise
        return True

    def _reset(self, patience_s: tuple[float, ...] = RESET_S) -> None:
        """Soft reset, as often as there are waits for its banner; returns at the banner."""
        self._lines.discard()
        self._forget_move()
        for wait_s in patience_s:
            self._transport.write(b"\x18")
            if self._banner_came(wait_s):
                return
        raise NoAnswer(f"{self._name}: no answer to a reset")

    def _banner_came(self, timeout_s: float) -> bool:
        """Wait for the banner; not for long from a controller that says anything else, for it did not restart."""
        deadline = self._clock.now() + timeout_s
        asked = True
        while (left := deadline - self._clock.now()) > 0.0:
            if not asked:
                self._transport.write(b"?")
            line = self._lines.next(min(left, AWAKE_S))
            asked = line is not None
            if line is None:
                continue
            if line.startswith("Grbl "):
                return True
            elif line.startswith("ALARM:"):
                self.trusted = False
            elif line.startswith("error:") or parse_status(line) is not None:
                deadline = min(deadline, self._clock.now() + AWAKE_S)
        return False
