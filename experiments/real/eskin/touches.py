"""The touches of one e-skin recording: readings, places, and which of them may be learned from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.recording import read_recording

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
HELD_OUT = 500
GRID = 6


@dataclass(frozen=True, eq=False)
class SkinTouches:
    """N touches in recording order: ``response`` (N,192) in the source's unit, ``place_mm`` (N,2)."""

    response: Array
    place_mm: Array

    @classmethod
    def read(cls, path: Path) -> SkinTouches:
        """From a recording file; depth and press time are left aside: a skin in use doesn't know them."""
        frames = read_recording(path).frames
        if frames is None:
            raise ValueError(f"{path} holds no frames")
        flat = np.asarray(frames.voltage_v, dtype=float).reshape(len(frames), -1)
        return cls(flat, 1e3 * frames.history.contact_m[:, 0])

    @property
    def early(self) -> Rows:
        """Rows to learn and tune on: all but the last ``HELD_OUT``."""
        return np.arange(len(self.place_mm) - HELD_OUT)

    @property
    def held_out(self) -> Rows:
        """The last rows in recording order: looked at once, at the end."""
        return np.arange(len(self.place_mm) - HELD_OUT, len(self.place_mm))

    def tuning_folds(self) -> list[tuple[Rows, Rows]]:
        """Two time-ordered (earlier, next 400) splits of the early rows."""
        last = len(self.early)
        return [(np.arange(cut), np.arange(cut, cut + 400)) for cut in (last - 800, last - 400)]


def errors_mm(said_mm: Array, place_mm: Array) -> Array:
    """(N,) distances between said and true places."""
    return np.linalg.norm(said_mm - place_mm, axis=1)


def cells(place_mm: Array, low_mm: Array, high_mm: Array) -> NDArray[np.intp]:
    """(N,2) cell of each place on a grid of ``GRID`` x ``GRID`` over the box from ``low_mm`` to ``high_mm``."""
    share = (place_mm - low_mm) / (high_mm - low_mm)
    return np.clip((share * GRID).astype(int), 0, GRID - 1)


def hit_rate(said_mm: Array, touches: SkinTouches, rows: Rows) -> float:
    """Share of touches said to lie in their true cell; the box is that of the early touches."""
    early_mm = touches.place_mm[touches.early]
    box = early_mm.min(axis=0), early_mm.max(axis=0)
    return float((cells(said_mm, *box) == cells(touches.place_mm[rows], *box)).all(axis=1).mean())
