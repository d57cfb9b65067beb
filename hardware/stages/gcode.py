"""What stages that take G-code have in common: the box they stay in, straight moves, homing, the way up."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from ertskin.hardware.driver import Driver
from ertskin.hardware.failure import LimitExceeded
from ertskin.hardware.instrument import Array, Travel
from ertskin.hardware.transport import Lines, Transport

ANSWER_S = 3.0
"""An answer that waits for no motion comes within this time."""
HOMING_S = 90.0
MOST_LINES = 200
"""Lines kept of what comes before an ``ok``, the newest: more than any firmware says of itself."""


class GcodeStage(Driver):
    """A stage that takes G-code, a line at a time, each answered before the next is sent."""

    kind = "stage"
    modes: tuple[str, ...] = ("G21", "G90")
    """Lines that set millimetres and absolute positions."""
    drain = ""
    """A line that is answered when every move before it has ended."""

    def __init__(self, transport: Transport, travel: Travel, home_command: str) -> None:
        """``travel``: the box the stage may move in, in the firmware's coordinates."""
        super().__init__(transport)
        self.travel = travel
        self.trusted = False
        self._home_command = home_command
        self._lines = Lines(transport)
        self._target_m: Array | None = None
        self._arrived_m: Array | None = None

    @abstractmethod
    def position_m(self) -> Array:
        """(3,) where the stage is."""

    def home(self) -> None:
        """Find the frame's origin; the position is trusted from then on."""
        self._forget_move()
        self._command(self._home_command, HOMING_S)
        self._set_modes()
        self.trusted = True

    def start_move(self, target_m: Array, speed_m_s: float) -> float:
        """Begin a straight move; returns the seconds it should take."""
        if not self.travel.holds(target_m):
            raise LimitExceeded(f"{self._name}: {millimetres(target_m)} mm lies outside the stage's travel")
        start = self.position_m() if self._arrived_m is None else self._arrived_m
        seconds = float(np.linalg.norm(target_m - start)) / speed_m_s
        self._forget_move()
        self._target_m = target_m
        x, y, z = 1e3 * target_m
        self._begin(f"G1 X{x:.3f} Y{y:.3f} Z{z:.3f} F{6e4 * speed_m_s:.1f}", seconds)
        return seconds

    def raise_by(self, height_m: float, speed_m_s: float) -> None:
        """Straight up, relative to wherever the stage is; returns when done."""
        if self.trusted:
            height_m = min(height_m, self.travel.high_m[2] - float(self.position_m()[2]))
        if height_m <= 0.0:
            return
        self._forget_move()
        self._command("G91")
        try:
            self._command(f"G1 Z{1e3 * height_m:.3f} F{6e4 * speed_m_s:.1f}")
            self._command(self.drain, ANSWER_S + 2.0 * height_m / speed_m_s)
        finally:
            self._command("G90")

    @abstractmethod
    def _command(self, line: str, timeout_s: float = ANSWER_S) -> list[str]:
        """Send one line and return what came before its ``ok``."""

    @abstractmethod
    def _begin(self, line: str, seconds: float) -> None:
        """Send a straight move that should take so long, its ``_target_m`` already set."""

    def _set_modes(self) -> None:
        for line in self.modes:
            self._command(line)

    def _forget_move(self) -> None:
        self._target_m = self._arrived_m = None


def millimetres(position_m: Array) -> str:
    """(3,) metres as a person reads them."""
    return ", ".join(f"{1e3 * value:.3f}" for value in position_m)
