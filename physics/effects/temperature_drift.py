"""The whole sheet's resistance drifts with recording time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, SheetEffect, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor


@dataclass(frozen=True)
class TemperatureDrift(SheetEffect):
    """Sheet resistance times exp(rate s(t) + bend t^2), t counted from 0, pressed or not.

    s(t) = settle (1 - exp(-t/settle)): a room that comes to rest; with a long time to settle it is t itself.
    """

    name: ClassVar[str] = "temperature_drift"
    source: ClassVar[str] = "PPy-coated fabric changes by about -0.6 %/K; a room by kelvins an hour"
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.TIME,), (Signal.READINGS, Signal.REST), (Need.REST_FRAMES,), must_show_at_rest=True
    )

    rate_per_h: float = parameter("1/h", -5.0, 5.0, 0.0, 0.02, "relative change of resistance per hour at the start")
    bend_per_h2: float = parameter("1/h^2", -50.0, 50.0, 0.0, 0.1, "how the rate changes")
    settle_h: float = parameter("h", 0.005, 1000.0, 1000.0, 0.1, "time constant of settling", defining=False)

    def drift(self, time_s: Array) -> Array:
        hours = time_s / 3600.0
        settled = -self.settle_h * np.expm1(-hours / self.settle_h)
        return np.asarray(np.exp(self.rate_per_h * settled + self.bend_per_h2 * hours**2))

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Log conductance of the sheet gained 300 s after the recording's start."""
        return {"log_change_300_s": float(-np.log(self.drift(np.array([300.0]))[0]))}

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        """A drift that bends, and rooms that settle quickly or slowly."""
        bent = ("rate_per_h", "bend_per_h2")
        settling = (cls(settle_h=settle_h) for settle_h in (0.03, 0.3))
        return Start(cls(), bent, bent), *(Start(s, ("rate_per_h", "settle_h"), ("rate_per_h",)) for s in settling)
