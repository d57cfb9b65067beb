"""What is never the same twice: how hard a press comes through, and how well each electrode touches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.virtual.bench.truth import Truth

Array = NDArray[np.float64]

PULL_BACK = 0.85


class Repeatability:
    """Changes from press to press: call ``next_press`` before each.

    ``gain`` multiplies the pressure that a force makes; ``contact_ohm`` (L,) are the contact resistances now.
    """

    def __init__(self, truth: Truth, purpose: str) -> None:
        self._truth, self._rng = truth, truth.rng(f"repeatability {purpose}")
        self._nominal = np.array(truth.contact_ohm)
        self._walk = np.zeros(len(self._nominal))
        self.gain = 1.0
        self.contact_ohm = self._nominal
        self._off_m = np.zeros(2)

    def next_press(self) -> None:
        """Draw what the next press will be like."""
        noise = self._truth.noise
        self.gain = float(np.exp(self._rng.normal(0.0, 1.0) * noise.press_gain))
        self._walk = PULL_BACK * self._walk + self._rng.normal(0.0, 1.0, len(self._walk)) * noise.walk_share
        self.contact_ohm = self._nominal * np.exp(self._walk)
        chance, size = self._rng.random(), self._rng.exponential(1.0)
        loose = self._truth.parameters("intermittent_electrode")
        if loose and chance < loose["share"]:
            self.contact_ohm[loose["electrode"]] += loose["jump_ohm"] * size

        # Only where it counts: a draw more would change all that comes after it.
        self._off_m = self._rng.normal(0.0, noise.landing_m, 2) if noise.landing_m > 0.0 else np.zeros(2)

    def scanned_ohm(self) -> Array:
        """(L,) the contact resistances of one scan."""
        share = self._truth.noise.jitter_share
        # Only where it counts: a draw more would change all that comes after it.
        return (
            self.contact_ohm * np.exp(share * self._rng.normal(0.0, 1.0, len(self._nominal)))
            if share
            else self.contact_ohm
        )

    def placed_m(self, landing_m: Array) -> Array:
        """(P,2) where things put down by hand come to lie."""
        spread = self._truth.noise.placement_m
        return landing_m if spread <= 0.0 else landing_m + self._rng.normal(0.0, spread, landing_m.shape)

    def landed_m(self, landing_m: Array) -> Array:
        """(P,2) where the stage comes down in this press."""
        return landing_m + self._off_m
