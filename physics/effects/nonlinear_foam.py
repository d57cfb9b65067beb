"""The foam stiffens (or buckles) with depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, FoamEffect, Start, Strokes, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import Standard

NEWTON_STEPS = 8
"""From the whole force downwards on a convex curve: more than rounding needs."""


@dataclass(frozen=True)
class NonlinearFoam(FoamEffect):
    """Force times 1 + stiffening (s/h)^exponent, s the sinking and h the foam's thickness.

    ``carried`` is the share of the added force that the sheet doesn't feel: at 0 all of it arrives as pressure, at 1
    the pressure is that of the linear pad at the same sinking. Force and depth can't tell, the readings can.
    """

    name: ClassVar[str] = "nonlinear_foam"
    source: ClassVar[str] = (
        "Leading even term of the Ogden-Hill hyperfoam in compression; neoprene halves its thickness near 150 kPa"
    )
    order: ClassVar[int] = 0
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.FORCE,), (Signal.FORCE,), (Need.FORCES,), also_in_readings=("carried",)
    )

    stiffening: float = parameter("1", -0.9, 20.0, 0.0, 0.1, "relative stiffening at a sinking of one foam thickness")
    exponent: float = parameter("1", 0.5, 6.0, 2.0, 0.2, "power of the sinking", defining=False)
    carried: float = parameter("1", -1.0, 2.0, 0.0, 0.2, "added force that is no pressure on the sheet", defining=False)

    def reaction_n(self, force_n: Array, strokes: Strokes) -> Array:
        sink = np.clip(strokes.sink_m / strokes.foam_m, 0.0, None)
        return force_n * (1 + self.stiffening * sink**self.exponent)

    def felt_n(self, force_n: Array, pad_n_per_m: float, foam_m: float) -> Array:
        if self.carried == 0 or self.stiffening == 0 or not np.isfinite(pad_n_per_m):
            return force_n
        known_n, most_n = np.where(np.isfinite(force_n), force_n, 0.0), np.inf
        linear = known_n
        if self.stiffening < 0:
            # Foam that softens gives way beyond the force at which its own falls: no linear force has more than that.
            most_n = pad_n_per_m * foam_m * (-1 / ((1 + self.exponent) * self.stiffening)) ** (1 / self.exponent)
        for _ in range(NEWTON_STEPS):
            added = self.stiffening * (linear / (pad_n_per_m * foam_m)) ** self.exponent
            wrong = linear * (1 + added) - known_n
            linear = np.clip(linear - wrong / np.maximum(1 + (1 + self.exponent) * added, 0.1), 0.0, most_n)
        return force_n - self.carried * (force_n - linear)

    def misread(self) -> dict[str, float]:
        return {"carried": 1.0} if self.stiffening < 0 else {}

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Force over linear force, less one, sunk as far as the deepest press."""
        strokes = standard.sunk(np.ones(1), np.zeros(1))
        force = self.reaction_n(strokes.elastic_n, strokes)
        return {"stiffening_at_deepest": float(force[0] / strokes.elastic_n[0] - 1)}

    @classmethod
    def force_starts(cls) -> tuple[Start, ...]:
        return (Start(cls(stiffening=0.2), tuple(cls.parameters())),)
