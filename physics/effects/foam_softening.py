"""The foam is stiffer the first time it is pressed (Mullins effect)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from physics.effects.effect import Array, FoamEffect, Strokes, parameter


@dataclass(frozen=True)
class FoamSoftening(FoamEffect):
    """Force times 1 + excess v: v = 1 beyond the deepest sinking a place has seen, less where it has been before.

    Within the first press, unloading keeps the part ``kept`` of the excess (0: Mullins' softening at once, 1: the whole
    first cycle stays stiff). In the n-th press of the same place v is exp(-n/``presses``) at sinkings seen before.
    """

    name: ClassVar[str] = "foam_softening"
    source: ClassVar[str] = "Mullins, Rubber Chem. Technol. 42 (1969) 339; Ogden & Roxburgh, Proc. R. Soc. A 455 (1999)"
    order: ClassVar[int] = 1

    excess: float = parameter("1", 0.0, 3.0, 0.0, 0.05, "how much stiffer the virgin foam is")
    kept: float = parameter(
        "1", 0.0, 1.0, 1.0, 0.2, "part of the excess that lasts to the end of a press", defining=False
    )
    presses: float = parameter("1", 0.05, 50.0, 0.3, 0.3, "presses over which the excess fades", defining=False)

    def reaction_n(self, force_n: Array, strokes: Strokes) -> Array:
        factor = np.ones(len(force_n))
        deepest: dict[int, float] = {}
        earlier: dict[int, float] = {}
        count: dict[int, int] = {}
        current: dict[int, int] = {}
        for t in np.flatnonzero(strokes.touched):
            place, press = int(strokes.place[t]), int(strokes.press[t])
            if current.get(place) != press:
                count[place] = count.get(place, -1) + 1
                earlier[place] = deepest.get(place, 0.0)
                current[place] = press
            sink = float(strokes.sink_m[t])
            virgin = 1.0 if sink > earlier[place] else float(np.exp(-count[place] / self.presses))
            unloading = sink < deepest.get(place, 0.0) and sink > earlier[place]
            factor[t] = 1 + self.excess * (virgin * self.kept if unloading else virgin)
            deepest[place] = max(deepest.get(place, 0.0), sink)
        return force_n * factor
