"""A stage on a Marlin controller.

Protocol: marlinfw.org (G-code index; ``M110``, ``M114``, ``M400``, ``M410``, host keep-alive) and MarlinFirmware/Marlin
``gcode/queue.cpp``. Every line is sent as ``N<number> <command>*<checksum>``, the checksum being the exclusive or of
all bytes before ``*``; answers are ``ok``, ``Resend: <number>``, ``Error:...`` and, while a command runs,
``echo:busy:``.
``M410`` stops at once only where the firmware has EMERGENCY_PARSER; without it at the end of the present move.
"""

from __future__ import annotations

import re

import numpy as np

from hardware.failure import InstrumentError, LimitExceeded, NoAnswer, Refusal
from hardware.instrument import Array, Travel
from hardware.transport import RECONNECT_S, Lines, Transport

ANSWER_S = 3.0
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


class Marlin:
    """A stage on a Marlin controller. ``home_command`` must not drive the indenter into the sensor."""

    def __init__(self, transport: Transport, travel: Travel, home_command: str = "G28") -> None:
        """``travel``: the box the stage may move in, in the firmware's coordinates."""
        self.travel = travel
        self.trusted = False
        self._home_command = home_command
        self._transport = transport
        self._clock = transport.clock
        self._lines = Lines(transport)
        self._number = 0
        self._target_m: Array | None = None
        self._arrived_m: Array | None = None
        self._waiting_since: float | None = None
        self._move_s = 0.0

    # ------------------------------------------------------------------------------------------------ the interface

    def identify(self) -> str:
        """Marlin's name and version."""
        self._lines.discard()
        self._restart_numbering()
        for line in self._command("M115"):
            if line.startswith("FIRMWARE_NAME:Marlin"):
                self._command("G21")
                self._command("G90")
                return line.removeprefix("FIRMWARE_NAME:").split(" (")[0].split(" SOURCE")[0]
        raise Refusal(f"{self._name}: is no Marlin")

    def home(self) -> None:
        """Run the homing command; the position is trusted from then on."""
        self._arrived_m = None
        self._command(self._home_command, LONGEST_BUSY_S)
        self._command("G90")
        self.trusted = True

    def position_m(self) -> Array:
        """(3,) where the stage is, all moves done."""
        self._finish_move()
        for _ in range(3):
            for line in self._command("M114"):
                position = parse_position(line)
                if position is not None:
                    return position
        raise NoAnswer(f"{self._name}: no position")

    def start_move(self, target_m: Array, speed_m_s: float) -> float:
        """Begin a straight move; ``M400`` behind it is answered when it has ended."""
        if not self.travel.holds(target_m):
            millimetres = ", ".join(f"{1e3 * value:.3f}" for value in target_m)
            raise LimitExceeded(f"{self._name}: {millimetres} mm lies outside the stage's travel")
        self._finish_move()
        start = self.position_m() if self._arrived_m is None else self._arrived_m
        distance = float(np.linalg.norm(target_m - start))
        self._arrived_m = None
        x, y, z = 1e3 * target_m
        self._command(f"G1 X{x:.3f} Y{y:.3f} Z{z:.3f} F{6e4 * speed_m_s:.1f}")
        self._target_m = target_m
        self._move_s = distance / speed_m_s
        self._number += 1
        self._waiting_since = self._clock.now()
        self._transport.write(numbered(self._number, "M400"))
        return self._move_s

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
        self._target_m = self._arrived_m = None
        self._waiting_since = None
        self._number += 1
        self._transport.write(numbered(self._number, "M410"))
        self._clock.sleep(0.3)
        self._lines.discard()
        self._restart_numbering()

    def recover(self) -> None:
        """Reopen the port (which restarts most boards), clear a stop, start the numbering anew."""
        self._target_m = self._arrived_m = None
        self._waiting_since = None
        try:
            self._settle()
        except InstrumentError:
            self.trusted = False
            if not self._transport.restore(RECONNECT_S):
                self._transport.reopen()
            self._lines = Lines(self._transport)
            self._await_start()
            self._settle()

    def raise_by(self, height_m: float, speed_m_s: float) -> None:
        """Straight up, relative to wherever the stage is."""
        self._target_m = None
        if self.trusted:
            height_m = min(height_m, self.travel.high_m[2] - float(self.position_m()[2]))
        if height_m <= 0.0:
            return
        self._arrived_m = None
        self._command("G91")
        try:
            self._command(f"G1 Z{1e3 * height_m:.3f} F{6e4 * speed_m_s:.1f}")
            self._command("M400", ANSWER_S + 2.0 * height_m / speed_m_s)
        finally:
            self._command("G90")

    def close(self) -> None:
        """Let go of the port."""
        self._transport.close()

    # ------------------------------------------------------------------------------------------------- the protocol

    @property
    def _name(self) -> str:
        return f"stage {self._transport.name}"

    def _command(self, command: str, timeout_s: float = ANSWER_S) -> list[str]:
        """Send one numbered line and return what came before its ``ok``."""
        self._number += 1
        self._transport.write(numbered(self._number, command))
        return self._answer(command, timeout_s)

    def _answer(self, command: str, timeout_s: float) -> list[str]:
        """What comes before the ``ok`` of line ``_number``; sends it again as often as the firmware asks."""
        before: list[str] = []
        start = self._clock.now()
        deadline = start + timeout_s
        resends = 0
        skip_ok = False
        while True:
            line = self._lines.next(deadline - self._clock.now())
            if line is None or (resend := self._asked_for(line)) == self._number:
                # Nothing came, or the line came damaged: an ok that was lost shows as a request for the next line.
                resends += 1
                if resends > RESENDS or self._clock.now() - start > LONGEST_BUSY_S:
                    raise NoAnswer(f"{self._name}: no ok to {command!r} within {timeout_s:g} s")
                skip_ok = line is not None
                self._transport.write(numbered(self._number, command))
                deadline = self._clock.now() + ANSWER_S
            elif resend == self._number + 1:
                skip_ok = False
                self._lines.next(0.2)
                return before
            elif resend is not None:
                raise Refusal(f"{self._name}: asks for line {resend}, we are at {self._number}")
            elif line == "ok" or line.startswith("ok "):
                if not skip_ok:
                    return before
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
        overdue = self._clock.now() - self._waiting_since > allowed
        line = self._lines.next(timeout_s)
        if line is None and not overdue:
            return False
        if line is not None and (line.startswith("echo:busy:")):
            return False
        if line is not None and (line == "ok" or line.startswith("ok ")):
            self._waiting_since = None
            return True
        if line is not None and self._asked_for(line) is None:
            self._raise_if_stopped(line)
            return False
        # Lost or damaged: ask again; a Marlin that has done it asks for the line behind.
        self._waiting_since = None
        self._transport.write(numbered(self._number, "M400"))
        self._answer("M400", allowed)
        return True

    def _finish_move(self) -> None:
        while self._waiting_since is not None:
            self._arrived(0.1)

    def _restart_numbering(self) -> None:
        self._number = -1
        self._command("M110 N0")
        self._number = 0

    def _settle(self) -> None:
        self._lines.discard()
        self._clock.sleep(0.1)
        self._lines.discard()
        self._restart_numbering()
        self._command("M999")
        self._command("G21")
        self._command("G90")

    def _await_start(self) -> None:
        """Boards that restart when their port is opened say ``start``; the others say nothing."""
        deadline = self._clock.now() + BOOT_S
        while (line := self._lines.next(deadline - self._clock.now())) is not None:
            if line == "start":
                return
