"""The fabric's resistance drifts at constant pressure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from physics.effects.effect import Array, PiezoEffect, parameter
from physics.effects.exponential_memory import lagging


@dataclass(frozen=True)
class PiezoCreep(PiezoEffect):
    """The law answers to p + fraction m, m following p with time constant tau: the fabrics settle into one another."""

    name: ClassVar[str] = "piezo_creep"
    source: ClassVar[str] = "Standard linear solid in compliance; FSR drift, Hollinger & Wanderley (NIME 2006)"
    order: ClassVar[int] = 3

    fraction: float = parameter("1", 0.0, 2.0, 0.0, 0.02, "extra pressure felt after a long hold, over the pressure")
    time_s: float = parameter("s", 0.05, 5000.0, 5.0, 1.0, "time constant", defining=False)

    remembers_air: bool = False
    """Whether what a press left behind goes on into the next; otherwise an unloaded spot has recovered."""

    def effective_pressure_pa(self, pressure_pa: Array, position_m: Array, time_s: Array, extent_m: Array) -> Array:
        loaded = np.abs(pressure_pa).max(axis=1, initial=0.0) > 0
        cleared = None if self.remembers_air else ~loaded
        return pressure_pa + self.fraction * lagging(pressure_pa, time_s, self.time_s, cleared)
