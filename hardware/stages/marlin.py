"""A stage on a Marlin controller.

Protocol: marlinfw.org (G-code index; ``M110``, ``M114``, ``M400``, ``M410``, host keep-alive) and MarlinFirmware/Marlin
``gcode/queue.cpp``. Every line is sent as ``N<number> <command>*<checksum>``, the checksum being the exclusive or of
all bytes before ``*``; answers are ``ok``, ``Resend: <number>``, ``Error:...`` and, while a command runs,
``echo:busy:``.
``M410`` stops at once only where the firmware has EMERGENCY_PARSER; without it at the end of the present move.
"""

from __future__ import annotations

import re
from collections import deque

import numpy as np

from ertskin.hardware.failure import InstrumentError, NoAnswer, Refusal
from ertskin.hardware.instrument import Array, Travel
from ertskin.hardware.stages.gcode import ANSWER_S, MOST_LINES, GcodeStage
from ertskin.hardware.transport import RECONNECT_S, Lines, Transport

LONGEST_BUSY_S = 120.0
BOOT_S = 4.0
RESENDS = 6
TOLERANCE_M = 20e-6
_POSITION = re.compile(r"X:(-?\d{1,5}\.\d{2,4}) Y:(-?\d{1,5}\.\d{2,4}) Z:(-?\d{1,5}\.\d{2,4})(?: .*)?", re.ASCII)
_RESEND = re.compile(r"(?:Resend:|rs) ?N?(\d{1,9})", re.ASCII)


def numbered(number: int, command: str) -> bytes:
    """The line ``N<number> <command>*<checksum>`` with its line feed."""
    body = f"N{number} {command}".encode("ascii")
    checksum = int(np.bitwise_xor.reduce(np.frombuffer(body, dtype=np.uint8)))
    return body + f"*{checksum}\n".encode("ascii")


def parse_position(line: str) -> Array | None:
    """(3,) metres from ``X:1.00 Y:2.00 Z:3.00 E:0.00 Count ...``, or None where the line is something else."""
    match = _POSITION.fullmatch(line)
    return None if match is None else 1e-3 * np.array([float(number) for number in match.groups()])


class Marlin(GcodeStage):
    """A stage on a Marlin controller. ``home_command`` must not drive the indenter into the sensor."""

    drain = "M400"

    def __init__(self, transport: Transport, travel: Travel, home_command: str = "G28") -> None:
        """``travel``: the box the stage may move in, in the firmware's coordinates."""
        super().__init__(transport, travel, home_command)
        self._number = 0
        self._waiting_since: float | None = None
        self._move_s = 0.0

    # ------------------------------------------------------------------------------------------------ the interface

    def identify(self) -> str:
        """Marlin's name and version; raises ``NoAnswer`` after six seconds without an answer."""
        self._lines.discard()
        self._restart_numbering(resends=1)
        for line in self._command("M115"):
            if line.startswith("FIRMWARE_NAME:Marlin"):
                self._set_modes()
                return line.removeprefix("FIRMWARE_NAME:").split(" (")[0].split(" SOURCE")[0]
        raise Refusal(f"{self._name}: is no Marlin")

    def position_m(self) -> Array:
        """(3,) where the stage is, all moves done."""
        self._finish_move()
        for _ in range(3):
            for line in self._command("M114"):
                position = parse_position(line)
                if position is not None:
                    return position
        raise NoAnswer(f"{self._name}: no position")

    def moving(self) -> bool:
        """Whether the last move is still under way."""
        if self._waiting_since is not None and not self._arrived(0.0):
            return True
        if self._target_m is not None:
            target, self._target_m = self._target_m, None
            self._arrived_m = self.position_m()
            if np.abs(self._arrived_m - target).max() > TOLERANCE_M:
                raise Refusal(f"{self._name}: stopped away from its target")
        return False

    def halt(self) -> None:
        """Stop at once and drop the queued moves."""
        self._forget_move()
        self._number += 1
        self._transport.write(numbered(self._number, "M410"))
        self._clock.sleep(0.3)
        self._lines.discard()
        self._restart_numbering(resends=1)

    def recover(self) -> None:
        """Reopen the port (which restarts most boards), clear a stop, start the numbering anew."""
        self._forget_move()
        try:
            self._settle()
        except InstrumentError:
            self.trusted = False
            if not self._transport.restore(RECONNECT_S):
                self._transport.reopen()
            self._lines = Lines(self._transport)
            self._await_start()
            self._settle()

    # ------------------------------------------------------------------------------------------------- the protocol

    def _command(self, command: str, timeout_s: float = ANSWER_S, resends: int = RESENDS) -> list[str]:
        """Send one numbered line and return what came before its ``ok``."""
        self._number += 1
        self._transport.write(numbered(self._number, command))
        return self._answer(command, timeout_s, resends)

    def _begin(self, line: str, seconds: float) -> None:
        """The move, and behind it a line that is answered when it has ended."""
        self._command(line)
        self._move_s = seconds
        self._number += 1
        self._waiting_since = self._clock.now()
        self._transport.write(numbered(self._number, self.drain))

    def _forget_move(self) -> None:
        super()._forget_move()
        self._waiting_since = None

    def _answer(self, command: str, timeout_s: float, most_resends: int = RESENDS) -> list[str]:
        """What comes before the ``ok`` of line ``_number``; sends it again as often as the firmware asks."""
        before: deque[str] = deque(maxlen=MOST_LINES)
        start = self._clock.now()
        deadline = start + timeout_s
        resends = 0
        skip_ok = False
        while True:
            line = self._lines.next(deadline - self._clock.now())
            if line is None or (resend := self._asked_for(line)) == self._number:
                # Nothing came, or the line came damaged: an ok that was lost shows as a request for the next line.
                resends += 1
                if resends > most_resends or self._clock.now() - start > LONGEST_BUSY_S:
                    raise NoAnswer(f"{self._name}: no ok to {command!r} within {timeout_s:g} s")
                skip_ok = line is not None
                self._transport.write(numbered(self._number, command))
                deadline = self._clock.now() + ANSWER_S
            elif resend == self._number + 1:
                skip_ok = False
                self._lines.next(0.2)
                return list(before)
            elif resend is not None:
                raise Refusal(f"{self._name}: asks for line {resend}, we are at {self._number}")
            elif line == "ok" or line.startswith("ok "):
                if not skip_ok:
                    return list(before)
                skip_ok = False
            elif line.startswith("echo:busy:"):
                if self._clock.now() - start > LONGEST_BUSY_S:
                    raise NoAnswer(f"{self._name}: busy for more than {LONGEST_BUSY_S:g} s with {command!r}")
                deadline = max(deadline, self._clock.now() + timeout_s)
            else:
                self._raise_if_stopped(line)
                before.append(line)

    def _asked_for(self, line: str) -> int | None:
        match = _RESEND.fullmatch(line)
        return int(match[1]) if match else None

    def _raise_if_stopped(self, line: str) -> None:
        if line == "start":
            self.trusted = False
            raise Refusal(f"{self._name}: was reset, its position is lost")
        fatal = ("kill()", "halted", "Endstop", "Homing", "STOP")
        if line.startswith("Error:") and any(word in line for word in fatal):
            self.trusted = False
            raise Refusal(f"{self._name}: {line}")

    def _arrived(self, timeout_s: float) -> bool:
        """Whether ``M400`` has been answered."""
        assert self._waiting_since is not None
        allowed = ANSWER_S + 2.0 * self._move_s
        waited = self._clock.now() - self._waiting_since
        line = self._lines.next(timeout_s)
        if line is None and waited <= allowed:
            return False
        if line is not None and line.startswith("echo:busy:"):
            if waited > allowed + LONGEST_BUSY_S:
                raise NoAnswer(f"{self._name}: busy {LONGEST_BUSY_S:g} s longer than the move should take")
            return False
        if line is not None and (line == "ok" or line.startswith("ok ")):
            self._waiting_since = None
            return True
        if line is not None and self._asked_for(line) is None:
            self._raise_if_stopped(line)
            if waited <= allowed:
                return False
        # Lost, damaged or drowned: ask again; a Marlin that has done it asks for the line behind.
        self._waiting_since = None
        self._transport.write(numbered(self._number, "M400"))
        self._answer("M400", allowed)
        return True

    def _finish_move(self) -> None:
        while self._waiting_since is not None:
            self._arrived(0.1)

    def _restart_numbering(self, resends: int = RESENDS) -> None:
        self._number = -1
        self._command("M110 N0", resends=resends)
        self._number = 0

    def _settle(self) -> None:
        self._lines.discard()
        self._clock.sleep(0.1)
        self._lines.discard()
        self._restart_numbering()
        self._command("M999")
        self._set_modes()

    def _await_start(self) -> None:
        """Boards that restart when their port is opened say ``start``; the others say nothing."""
        deadline = self._clock.now() + BOOT_S
        while (line := self._lines.next(deadline - self._clock.now())) is not None:
            if line == "start":
                return
