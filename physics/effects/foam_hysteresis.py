"""Rate-independent loss of the foam: less force on the way out than on the way in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numba import njit

from physics.effects.effect import Array, FoamEffect, Strokes, parameter

_CONTACT = 1e-12


@dataclass(frozen=True)
class FoamHysteresis(FoamEffect):
    """Force times 1 + loss z, z from +1 (loading) to -1 (unloading): a stop operator in the logarithm of the force.

    z changes by 2/``reversal`` per unit of the logarithm of the elastic force and starts at +1 with every touch.
    """

    name: ClassVar[str] = "foam_hysteresis"
    source: ClassVar[str] = "Visintin, Differential Models of Hysteresis (1994), ch. III: stop operator"
    order: ClassVar[int] = 2

    loss: float = parameter("1", 0.0, 0.8, 0.0, 0.03, "half the loop's height over the mean force")
    reversal: float = parameter("1", 0.005, 2.0, 0.1, 0.05, "relative force over which it turns round", defining=False)

    def reaction_n(self, force_n: Array, strokes: Strokes) -> Array:
        log_force = np.log(np.maximum(force_n, _CONTACT))
        goes_on = strokes.touched.copy()
        goes_on[1:] &= strokes.touched[:-1] & (strokes.place[1:] == strokes.place[:-1])
        goes_on[:1] = False
        return force_n * (1 + self.loss * _stop(log_force, goes_on, 2 / self.reversal))


@njit(cache=True)
def _stop(log_force, goes_on, rate):  # type: ignore[no-untyped-def]
    side = np.ones(len(log_force))
    for t in range(1, len(log_force)):
        if goes_on[t]:
            moved = side[t - 1] + rate * (log_force[t] - log_force[t - 1])
            side[t] = min(max(moved, -1.0), 1.0)
    return side
