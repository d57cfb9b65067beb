"""The fabric's sensitivity to pressure varies over the sheet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, PiezoEffect
from ertskin.physics.effects.field_over_sheet import FieldOverSheet
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal


@dataclass(frozen=True)
class PiezoInhomogeneity(FieldOverSheet, PiezoEffect):
    """Pressure times exp(g(x)): spot, line, step, slope, smooth field."""

    name: ClassVar[str] = "piezo_inhomogeneity"
    source: ClassVar[str] = "Paper III-D: the left-top area of the real sensor is more sensitive, from fabrication"
    order: ClassVar[int] = 0
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.PLACE, Axis.FORCE), (Signal.READINGS,), (Need.PRESSES,), field=True
    )

    def effective_pressure_pa(self, pressure_pa: Array, position_m: Array, time_s: Array, extent_m: Array) -> Array:
        return pressure_pa * np.exp(self.logarithm(position_m, extent_m))
