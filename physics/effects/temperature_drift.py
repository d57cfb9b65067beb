"""The whole sheet's resistance drifts with recording time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from physics.effects.effect import Array, SheetEffect, parameter


@dataclass(frozen=True)
class TemperatureDrift(SheetEffect):
    """Sheet resistance times exp(rate t + bend t^2), t from the recording's first frame, pressed or not."""

    name: ClassVar[str] = "temperature_drift"
    source: ClassVar[str] = "PPy-coated fabric changes by about -0.6 %/K; a room by kelvins an hour"

    rate_per_h: float = parameter("1/h", -5.0, 5.0, 0.0, 0.02, "relative change of resistance per hour at the start")
    bend_per_h2: float = parameter("1/h^2", -50.0, 50.0, 0.0, 0.1, "how the rate changes")

    def drift(self, time_s: Array) -> Array:
        hours = (time_s - time_s[0]) / 3600.0
        return np.asarray(np.exp(self.rate_per_h * hours + self.bend_per_h2 * hours**2))
