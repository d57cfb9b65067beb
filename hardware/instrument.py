"""The three small interfaces a bench is made of: a stage, a load cell, an ERT reader. SI units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Travel:
    """The box a stage may move in: ``low_m`` and ``high_m`` are x, y, z in metres, z upward."""

    low_m: tuple[float, float, float]
    high_m: tuple[float, float, float]

    def holds(self, position_m: Array) -> bool:
        """Whether a position lies inside, to a micrometre."""
        low, high = np.array(self.low_m), np.array(self.high_m)
        return bool(np.all(position_m >= low - 1e-6) and np.all(position_m <= high + 1e-6))


@dataclass(frozen=True)
class Force:
    """A load cell's sample: newton, compression positive, and when it arrived (seconds of the bench's clock)."""

    time_s: float
    force_n: float


@dataclass(frozen=True, eq=False)
class Scan:
    """One scan of an ERT reader.

    ``time_s``: its start on the bench's clock. ``voltage_v`` (K,M) float32. ``count`` (K,M) raw converter counts and
    ``saturated`` (K,M), where the device gives them. ``lost``: scans the device made, or began, since the last one
    handed out that never arrived whole.
    """

    time_s: float
    voltage_v: NDArray[np.float32]
    count: NDArray[np.int32] | None = None
    saturated: NDArray[np.bool_] | None = None
    sequence: int | None = None
    lost: int = 0


class Stage(Protocol):
    """A three-axis stage. Positions (3,) in metres in its own frame, z upward.

    ``trusted``: whether it is known where the stage is; homing makes it so, a reset or lost contact ends it.
    """

    travel: Travel
    trusted: bool

    def identify(self) -> str:
        """The device's name for itself; raises ``InstrumentError`` where it is another kind of device."""
        ...

    def home(self) -> None:
        """Find the frame's origin; returns when done."""
        ...

    def position_m(self) -> Array:
        """(3,) where the stage is."""
        ...

    def start_move(self, target_m: Array, speed_m_s: float) -> float:
        """Begin a straight move; returns the seconds it should take. Raises ``LimitExceeded`` outside ``travel``."""
        ...

    def moving(self) -> bool:
        """Whether the last move is still under way; raises ``Refusal`` where the device stopped it."""
        ...

    def halt(self) -> None:
        """Stop at once, wherever that is."""
        ...

    def recover(self) -> None:
        """Bring the device, after whatever happened, to where it takes moves again, without moving it."""
        ...

    def raise_by(self, height_m: float, speed_m_s: float) -> None:
        """Move straight up by so much from wherever the stage is, trusting no position; returns when done."""
        ...

    def close(self) -> None:
        """Let go of the line."""
        ...


class LoadCell(Protocol):
    """A load cell."""

    def identify(self) -> str:
        """What answers there; raises ``InstrumentError`` where it is another kind of device."""
        ...

    def force(self, timeout_s: float) -> Force:
        """The next sample; raises ``NoAnswer``."""
        ...

    def discard(self) -> None:
        """Forget samples that have arrived: the next one is fresh."""
        ...

    def restore(self) -> None:
        """After a failure: open the line anew where contact was lost; raises ``LostContact`` where it stays lost."""
        ...

    def close(self) -> None:
        """Let go of the line."""
        ...


class ErtReader(Protocol):
    """An ERT reader that gives scans of ``shape`` (K,M)."""

    shape: tuple[int, int]

    def identify(self) -> str:
        """What answers there; raises ``InstrumentError`` where it is another kind of device."""
        ...

    def start(self) -> None:
        """Ask for a scan that begins now, or, from a device that never stops, for the next one to begin."""
        ...

    def finish(self, timeout_s: float) -> Scan:
        """The scan asked for; raises ``NoAnswer`` after ``timeout_s``. A damaged scan is never handed out."""
        ...

    def restore(self) -> None:
        """After a failure: open the line anew where contact was lost; raises ``LostContact`` where it stays lost."""
        ...

    def close(self) -> None:
        """Let go of the line."""
        ...
