"""An emulated Marlin controller (the protocol's source is named in ``ertskin.hardware.stages.marlin``).

Motion has no inertia; a planner of 16 moves; ``M400`` and homing are answered at their end and say ``echo:busy:`` every
two seconds; with EMERGENCY_PARSER, so ``M410`` acts at once.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ertskin.hardware.stages.marlin import numbered
from ertskin.hardware.virtual.axes import Axes
from ertskin.hardware.virtual.terminal import DeviceClock, Terminal
from ertskin.hardware.virtual.world import World

PLANNER_MOVES = 16
BUSY_S = 2.0
REPLY_S = 0.003
_NUMBERED = re.compile(r"N(-?\d{1,9}) (.*)\*(\d{1,3})")
_AXIS = re.compile(r"([XYZFPEN])(-?\d+(?:\.\d+)?)")


class MarlinController(Terminal):
    """A Marlin 2.1 on a pseudo-terminal."""

    def __init__(self, clock: DeviceClock, link: Path, world: World, height_m: float = 0.08) -> None:
        """``height_m``: where z stands after homing, at its top."""
        super().__init__(clock, link, bytes_per_s=25_000.0)
        self.axes = Axes((0.0, 0.0, height_m))
        world.mover = self.axes
        self._height_m = height_m
        self._line = bytearray()
        self._queue: list[str] = []
        self._last = 0
        self._relative = False
        self._feed_m_s = 0.02
        self._answer_s: float | None = None
        self._busy_s = 0.0
        self._frozen_until_s = 0.0

    def power_on(self) -> None:
        """Start anew."""
        self.axes.stop(self.clock.now())
        self._line.clear()
        self._queue.clear()
        self._last = 0
        self._relative = False
        self._answer_s = None
        self.send(b"start\r\necho:Marlin 2.1.2\r\n", 0.3)

    def unplug(self, seconds: float = float("inf")) -> None:
        """The board is fed over its cable: pulled, it stops."""
        self.axes.stop(self.clock.now())
        super().unplug(seconds)

    def keep_busy(self, seconds: float) -> None:
        """Take nothing for a while, saying so."""
        self._frozen_until_s = self.clock.now() + seconds
        self._busy_s = self.clock.now() + BUSY_S

    def receive(self, data: bytes) -> None:
        """Lines; ``M410`` is picked out as it passes."""
        for byte in data:
            if byte not in (0x0A, 0x0D):
                if len(self._line) < 96:
                    self._line.append(byte)
                continue
            if self._line:
                text = self._line.decode("latin-1")
                self._line.clear()
                if "M410" in text:
                    self.axes.stop(self.clock.now())
                    self._answer_s = None
                    self._queue.clear()
                self._queue.append(text)

    def tick(self) -> None:
        """Answer what has ended, say busy, take the next lines."""
        now = self.clock.now()
        if self._answer_s is not None and now >= self._answer_s:
            self._answer_s = None
            self._ok()
        waiting = self._answer_s is not None or now < self._frozen_until_s
        if waiting and now >= self._busy_s:
            self._busy_s = now + BUSY_S
            self.send(b"echo:busy: processing\r\n")
        while self._queue and self._answer_s is None and now >= self._frozen_until_s:
            if self.axes.pending(now) >= PLANNER_MOVES:
                break
            self._take_line(self._queue.pop(0))

    def next_s(self) -> float:
        """The end of what is waited for, or the next busy message."""
        now = self.clock.now()
        if now < self._frozen_until_s:
            return min(self._frozen_until_s, self._busy_s)
        if self._answer_s is not None:
            return min(self._answer_s, self._busy_s)
        return self.axes.end_s if self._queue else float("inf")

    # --------------------------------------------------------------------------------------------------- internals

    def _ok(self) -> None:
        self.send(b"ok\r\n", REPLY_S)

    def _resend(self, reason: str) -> None:
        text = f"Error:{reason}, Last Line: {self._last}\r\nResend: {self._last + 1}\r\nok\r\n"
        self.send(text.encode(), REPLY_S)

    def _take_line(self, text: str) -> None:
        match = _NUMBERED.fullmatch(text)
        if match is None or not text.isascii():
            if text.startswith("N") or not text.isascii():
                return self._resend("No Checksum with line number")
            return self._execute(text)
        number, command = int(match[1]), match[2]
        if numbered(number, command).decode("latin-1").rstrip("\n") != text:
            return self._resend("checksum mismatch")
        if command.startswith("M110"):
            target = re.search(r" N(-?\d+)", command)
            self._last = int(target[1]) if target else number
            return self._ok()
        if number != self._last + 1:
            return self._resend("Line Number is not Last Line Number+1")
        self._last = number
        return self._execute(command)

    def _execute(self, command: str) -> None:
        code, _, rest = command.partition(" ")
        now = self.clock.now()
        if code in ("G0", "G1"):
            self._move({letter: float(value) for letter, value in _AXIS.findall(rest)})
        elif code == "G28":
            self.axes.go(np.array([*self.axes.end_m[:2], self._height_m]), 0.02, now)
            self.axes.go(np.array([0.0, 0.0, self._height_m]), 0.02, now)
            self._wait()
        elif code == "M400":
            self._wait()
        elif code in ("G90", "G91"):
            self._relative = code == "G91"
            self._ok()
        elif code == "M114":
            x, y, z = 1e3 * self.axes.end_m
            self.send(f"X:{x:.3f} Y:{y:.3f} Z:{z:.3f} E:0.00 Count X:0 Y:0 Z:0\r\nok\r\n".encode(), REPLY_S)
        elif code == "M115":
            text = "FIRMWARE_NAME:Marlin 2.1.2 (Jan 1 2026) SOURCE_CODE_URL:none PROTOCOL_VERSION:1.0\r\nok\r\n"
            self.send(text.encode(), REPLY_S)
        elif code in ("G21", "M410", "M999"):
            self._ok()
        else:
            self.send(f'echo:Unknown command: "{command}"\r\nok\r\n'.encode(), REPLY_S)

    def _wait(self) -> None:
        self._answer_s = max(self.axes.end_s, self.clock.now())
        self._busy_s = self.clock.now() + BUSY_S

    def _move(self, values: dict[str, float]) -> None:
        if values.get("F", 0.0) > 0.0:
            self._feed_m_s = values["F"] / 6e4
        target = self.axes.end_m.copy()
        for axis, letter in enumerate("XYZ"):
            if letter in values:
                moved = 1e-3 * values[letter]
                target[axis] = target[axis] + moved if self._relative else moved
        self.axes.go(target, self._feed_m_s, self.clock.now())
        self._ok()
