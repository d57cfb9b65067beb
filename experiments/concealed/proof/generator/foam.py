"""Force of the pad against how far it is sunk, the indenter's support in series, and what foams add to it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class FoamPart(Protocol):
    """One thing a foam does to the force; ``force`` may be asked for many trials, ``settle`` takes the last one."""

    stiffens: bool
    """Whether it changes how the pressure spreads, not only how large it is."""

    def begin(self, position_m: Array, stiffness_n_per_m: float, height_m: float) -> None:
        """A press begins here."""

    def force(self, force_n: float, sunk_m: float, since_s: float) -> float:
        """Force after this part, at a trial."""

    def settle(self, force_n: float, sunk_m: float, since_s: float) -> None:
        """The trial came true."""


class Pad:
    """A pad of some stiffness under an indenter on a support; remembers through its parts."""

    def __init__(self, stiffness_n_per_m: float, support_n_per_m: float, height_m: float, parts: Sequence[FoamPart]):
        self.stiffness, self.support, self.height, self.parts = stiffness_n_per_m, support_n_per_m, height_m, parts
        self.used = False

    def begin(self, position_m: Array) -> None:
        """A press begins: parts with a memory of places look up theirs."""
        self.used = True
        for part in self.parts:
            part.begin(position_m, self.stiffness, self.height)

    def _force(self, sunk_m: float, since_s: float) -> float:
        force = self.stiffness * sunk_m
        for part in self.parts:
            force = part.force(force, sunk_m, since_s)
        return max(force, 0.0)

    def advance(self, depth_m: float, since_s: float) -> tuple[float, float]:
        """Force (N) at a stage depth, and secant over linear stiffness as far as pressure spreads by it."""
        low, high = 0.0, max(depth_m, 0.0)
        for _ in range(60):
            sunk = 0.5 * (low + high)
            if self._force(sunk, since_s) < self.support * (depth_m - sunk):
                low = sunk
            else:
                high = sunk
        sunk = 0.5 * (low + high)
        force, secant = self.stiffness * sunk, 1.0
        for part in self.parts:
            after = part.force(force, sunk, since_s)
            part.settle(force, sunk, since_s)
            if part.stiffens and force > 0:
                secant *= after / force
            force = after
        return max(force, 0.0), secant
