"""The foam stiffens (or buckles) with depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from physics.effects.effect import Array, FoamEffect, Strokes, parameter


@dataclass(frozen=True)
class NonlinearFoam(FoamEffect):
    """Force times 1 + stiffening (s/h)^exponent, s the sinking and h the foam's thickness."""

    name: ClassVar[str] = "nonlinear_foam"
    source: ClassVar[str] = (
        "Leading even term of the Ogden-Hill hyperfoam in compression; neoprene halves its thickness near 150 kPa"
    )
    order: ClassVar[int] = 0

    stiffening: float = parameter("1", -0.9, 20.0, 0.0, 0.1, "relative stiffening at a sinking of one foam thickness")
    exponent: float = parameter("1", 0.5, 6.0, 2.0, 0.2, "power of the sinking", defining=False)

    def reaction_n(self, force_n: Array, strokes: Strokes) -> Array:
        sink = np.clip(strokes.sink_m / strokes.foam_m, 0.0, None)
        return force_n * (1 + self.stiffening * sink**self.exponent)
