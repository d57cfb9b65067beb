"""The fabric's sensitivity to pressure varies over the sheet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, PiezoEffect, Start, parameter
from ertskin.physics.effects.field_over_sheet import FieldOverSheet
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal


@dataclass(frozen=True)
class PiezoInhomogeneity(FieldOverSheet, PiezoEffect):
    """Pressure times exp((1 - r) g(x)), the law's log resistance over that at rest times exp(r g(x)): spot, line, step,
    slope, smooth field.

    Either way the law answers a light pressure exp(g) times as much. With the share r ``in_response`` at 0 fabric
    answers as if it were pressed harder, and saturates with the law; at 1 its whole response is so much more of the
    same, as where more fibres conduct. What multiplies the resistance besides, creep or warmth, stays as it is.
    """

    name: ClassVar[str] = "piezo_inhomogeneity"
    source: ClassVar[str] = "Paper III-D: the left-top area of the real sensor is more sensitive, from fabrication"
    order: ClassVar[int] = 0
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.PLACE, Axis.FORCE), (Signal.READINGS,), (Need.PRESSES,), field=True
    )

    in_response: float = parameter("1", 0.0, 1.0, 0.0, 0.2, "part of g that is in the response", defining=False)

    def effective_pressure_pa(self, pressure_pa: Array, position_m: Array, time_s: Array, extent_m: Array) -> Array:
        return pressure_pa * np.exp((1 - self.in_response) * self.logarithm(position_m, extent_m))

    def response_power(self, position_m: Array, extent_m: Array) -> Array | None:
        return np.exp(self.in_response * self.logarithm(position_m, extent_m)) if self.in_response else None

    def beginnings(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        """With the share in the response free, begun at nought and at one, for between them lie valleys: held, the
        field's values and the foam's modulus would make up for it."""
        freed = free if "in_response" in free else (*free, "in_response")
        return tuple(Start(self.changed({"in_response": part}), freed) for part in (0.0, 1.0))
