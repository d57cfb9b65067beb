"""An emulated GRBL 1.1 controller (the protocol's source is named in ``ertskin.hardware.stages.grbl``).

Motion has no inertia; a move's ``ok`` comes when it has been put into a planner of 15 moves, as GRBL's does. Soft
limits and homing are on: the travel runs from minus its length to zero on every axis, homing goes to the upper corner.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ertskin.hardware.virtual.axes import Axes
from ertskin.hardware.virtual.terminal import DeviceClock, Terminal
from ertskin.hardware.virtual.world import Array, World

PLANNER_MOVES = 15
BUFFER_BYTES = 128
LINE_BYTES = 80
RAPID_M_S = 0.05
HOMING_M_S = 0.02
REPLY_S = 0.004
RESET_S = 0.05
_WORD = re.compile(r"([A-Z])([+-]?(?:\d+\.?\d*|\.\d+))")
_KNOWN = {"G0", "G1", "G4", "G17", "G20", "G21", "G53", "G54", "G90", "G91", "G94"}


class GrblController(Terminal):
    """A GRBL 1.1 on a pseudo-terminal."""

    def __init__(
        self, clock: DeviceClock, link: Path, world: World, travel_m: tuple[float, float, float] = (0.2, 0.2, 0.08)
    ) -> None:
        """``travel_m``: lengths of the axes."""
        super().__init__(clock, link)
        self.axes = Axes((0.0, 0.0, 0.0))
        self.homing_m_s = HOMING_M_S
        self.reset_s = RESET_S
        world.mover = self.axes
        self._travel_m = np.array(travel_m)
        self._shift_m: Array = np.zeros(3)
        self._state = "Idle"
        self._held = False
        self._line = bytearray()
        self._queue: list[str] = []
        self._answer_s: float | None = None
        self._relative = False
        self._feed_m_s: float | None = None
        self._homing = False
        self._reports = 0
        self.power_on()

    def power_on(self) -> None:
        """Start anew: with homing enabled, locked until homed or unlocked, and taking its place for the origin."""
        self._restart("Alarm")
        self._shift_m = self.axes.end_m.copy()

    def unplug(self, seconds: float = float("inf")) -> None:
        """The board is fed over its cable: pulled, it stops."""
        self.axes.stop(self.clock.now())
        super().unplug(seconds)

    def trip(self, alarm: int = 1) -> None:
        """A hard limit, or another alarm that stops everything until a reset."""
        self.axes.stop(self.clock.now())
        self._queue.clear()
        self._answer_s = None
        self._homing = False
        self._state = "Alarm"
        self.send(f"ALARM:{alarm}\r\n[MSG:Reset to continue]\r\n".encode())

    def receive(self, data: bytes) -> None:
        """Real-time bytes act at once; the others make lines."""
        for byte in data:
            if byte == ord("?"):
                if not self._homing:
                    self._report()
            elif byte == ord("!"):
                self._hold()
            elif byte == ord("~"):
                self._held = False
            elif byte == 0x18:
                self._soft_reset()
            elif byte in (0x0A, 0x0D):
                if self._line or byte == 0x0A:
                    self._queue.append(self._line.decode("latin-1"))
                    self._line.clear()
            elif byte < 0x80:
                waiting = len(self._line) + sum(len(line) + 1 for line in self._queue)
                if waiting < BUFFER_BYTES:
                    self._line.append(byte)

    def tick(self) -> None:
        """Answer what has ended; take the next lines."""
        now = self.clock.now()
        if self._answer_s is not None and now >= self._answer_s:
            self._answer_s = None
            self._homing = False
            self._ok()
        while self._queue and self._answer_s is None and self.axes.pending(now) < PLANNER_MOVES:
            self._execute(self._queue.pop(0).upper().replace(" ", ""))

    def next_s(self) -> float:
        """The end of a dwell or homing, or of the move a full planner waits for."""
        if self._answer_s is not None:
            return self._answer_s
        return self.axes.end_s if self._queue else float("inf")

    # --------------------------------------------------------------------------------------------------- internals

    def _ok(self) -> None:
        self.send(b"ok\r\n", REPLY_S)

    def _error(self, number: int) -> None:
        self.send(f"error:{number}\r\n".encode(), REPLY_S)

    def _restart(self, state: str) -> None:
        self.axes.stop(self.clock.now())
        self._state = state
        self._held = self._homing = self._relative = False
        self._line.clear()
        self._queue.clear()
        self._answer_s = None
        self._feed_m_s = None
        self._reports = 0
        self.only_say(b"", self.reset_s)
        self.send(b"\r\nGrbl 1.1h ['$' for help]\r\n", self.reset_s)
        if state == "Alarm":
            self.send(b"[MSG:'$H'|'$X' to unlock]\r\n", self.reset_s)

    def _soft_reset(self) -> None:
        moving = self.axes.end_s > self.clock.now() and not self._held
        if moving or self._homing:
            self.send(f"ALARM:{6 if self._homing else 3}\r\n".encode())
        self._restart("Alarm" if moving or self._homing or self._state == "Alarm" else "Idle")

    def _hold(self) -> None:
        if self.axes.end_s > self.clock.now():
            self.axes.stop(self.clock.now())
            self._held = True
            self._answer_s = None

    def _report(self) -> None:
        now = self.clock.now()
        state = self._state
        if state == "Idle":
            state = "Hold:0" if self._held else "Run" if self.axes.end_s > now else "Idle"
        place = ",".join(f"{1e3 * value:.3f}" for value in self.axes.at(now) - self._shift_m)
        offset = "|WCO:0.000,0.000,0.000" if self._reports % 10 == 0 else ""
        self._reports += 1
        self.send(f"<{state}|MPos:{place}|FS:0,0{offset}>\r\n".encode(), 0.008)

    def _execute(self, line: str) -> None:
        if len(line) > LINE_BYTES:
            self._error(11)
        elif line.startswith("$"):
            self._system(line)
        elif not line:
            self._ok()
        elif self._state == "Alarm":
            self._error(9)
        else:
            self._block(line)

    def _system(self, line: str) -> None:
        if line == "$I":
            self.send(b"[VER:1.1h.20190830:]\r\n[OPT:V,15,128]\r\n", REPLY_S)
            self._ok()
        elif line == "$X":
            if self._state == "Alarm":
                self._state = "Idle"
                self.send(b"[MSG:Caution: Unlocked]\r\n", REPLY_S)
            self._ok()
        elif line == "$H":
            self._state = "Idle"
            self._homing = True
            now = self.clock.now()
            self.axes.go(np.array([*self.axes.end_m[:2], 0.0]), self.homing_m_s, now)
            self.axes.go(np.zeros(3), self.homing_m_s, now)
            self._shift_m = np.zeros(3)
            self._answer_s = self.axes.end_s + 0.5
        else:
            self._error(3)

    def _block(self, line: str) -> None:
        words = _WORD.findall(line)
        if "".join(letter + number for letter, number in words) != line:
            return self._error(2 if line[:1].isalpha() else 1)
        codes = {f"G{float(number):g}" for letter, number in words if letter == "G"}
        if not codes <= _KNOWN or any(letter not in "GXYZFPN" for letter, _ in words):
            return self._error(20)
        values = {letter: float(number) for letter, number in words if letter != "G"}
        if "F" in values:
            if values["F"] <= 0:
                return self._error(22)
            self._feed_m_s = values["F"] / 6e4
        self._relative = "G91" in codes or (self._relative and "G90" not in codes)
        if "G4" in codes:
            if "P" not in values:
                return self._error(28)
            self.axes.dwell(values["P"], self.clock.now())
            self._answer_s = self.axes.end_s
            return None
        if values.keys() & set("XYZ"):
            return self._move(values, "G0" in codes, "G53" in codes)
        return self._ok()

    def _move(self, values: dict[str, float], rapid: bool, machine: bool) -> None:
        if not rapid and self._feed_m_s is None:
            return self._error(22)
        target: Array = self.axes.end_m - self._shift_m
        for axis, letter in enumerate("XYZ"):
            if letter in values:
                moved = 1e-3 * values[letter]
                target[axis] = target[axis] + moved if self._relative and not machine else moved
        if (target > 1e-9).any() or (target < -self._travel_m - 1e-9).any():
            return self.trip(2)
        target = target + self._shift_m
        self.axes.go(target, RAPID_M_S if rapid or self._feed_m_s is None else self._feed_m_s, self.clock.now())
        return self._ok()
