"""The sheet's resistance drifts with recording time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.effects.effect import Array, PiezoEffect, SheetEffect, Start, parameter
from ertskin.physics.effects.exponential_memory import lagging, moves_within_s
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.effects.touching import touching_share
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

SWING = ("swing_sine", "swing_cosine")
GRADIENT = ("gradient_x", "gradient_y")
LOAD = ("load_rise", "load_lasts_s")
TOUCHING_PA = 200.0
"""Pressure at which half of a face touches: what is pressed any harder is warmed all alike. Fitted on one recording of
the proof's generator, c026 of ``eighth32``: 171 +- 22."""


@dataclass(frozen=True)
class WarmLoad(PiezoEffect):
    """Resistance times exp(rise m), m following with a time constant how much touches: what presses is warmer or colder
    than the sheet, and leaves its warmth behind. Creep that multiplies has the same law at higher pressures: beside a
    drift, the pressure that it takes tells one from the other."""

    rise: float
    lasts_s: float
    # Before every memory of the fabric: what touches is the pressure itself, not what a fabric still feels of it.
    order: ClassVar[int] = -2
    remembers_air: ClassVar[bool] = True

    def resistance_factor(
        self,
        pressure_pa: Array,
        position_m: Array,
        time_s: Array,
        extent_m: Array,
        wanted: NDArray[np.intp] | None = None,
    ) -> Array | float:
        touching = touching_share(pressure_pa, TOUCHING_PA)
        warm = lagging(touching, time_s, np.array([self.lasts_s]), None, moves_s=moves_within_s(time_s))
        return np.asarray(np.exp(self.rise * (warm if wanted is None else warm[wanted])))


@dataclass(frozen=True)
class TemperatureDrift(SheetEffect):
    """Sheet resistance times exp(d(t) (1 + g . r)), of a room that settles or swings, uneven over the sheet.

    t counts from the recording's first frame, r (2,) from the sheet's middle, one at its ends, and
    d(t) = rate s(t) + bend t^2 + sine sin(2 pi t/period) + cosine (cos(2 pi t/period) - 1),
    s(t) = settle (1 - exp(-t/settle)): a room that comes to rest; with a long time to settle it is t itself. A room
    whose heating or draught comes and goes swings; one side of a sheet may be nearer to it than the other. What presses
    may be warmer or colder than the sheet as well (``WarmLoad``).
    """

    name: ClassVar[str] = "temperature_drift"
    source: ClassVar[str] = "PPy-coated fabric changes by about -0.6 %/K; a room by kelvins an hour"
    form_error: ClassVar[float] = 0.15
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.TIME,), (Signal.READINGS, Signal.REST), (Need.REST_FRAMES,), must_show_at_rest=True
    )

    rate_per_h: float = parameter(
        "1/h", -5.0, 5.0, 0.0, 0.02, "relative change of resistance per hour at the start, but for the swing"
    )
    bend_per_h2: float = parameter("1/h^2", -50.0, 50.0, 0.0, 0.1, "how the rate changes")
    settle_h: float = parameter("h", 0.005, 1000.0, 1000.0, 0.1, "time constant of settling", defining=False)
    swing_sine: float = parameter("1", -1.0, 1.0, 0.0, 2e-3, "logarithm of the resistance, what swings as the sine")
    swing_cosine: float = parameter("1", -1.0, 1.0, 0.0, 2e-3, "logarithm of the resistance, what swings as the cosine")
    period_h: float = parameter("h", 0.02, 10.0, 0.3, 0.1, "period of the swing", defining=False)
    gradient_x: float = parameter(
        "1",
        -3.0,
        3.0,
        0.0,
        0.1,
        "how much more of it there is at the sheet's end along x than in its middle, as a share",
        defining=False,
    )
    gradient_y: float = parameter("1", -3.0, 3.0, 0.0, 0.1, "the same along y", defining=False)

    load_rise: float = parameter(
        "1", -0.5, 0.5, 0.0, 0.01, "logarithm of the resistance where something has pressed for long", defining=False
    )
    load_lasts_s: float = parameter("s", 1.0, 3600.0, 30.0, 5.0, "time constant of that", defining=False)

    @property
    def remembers_air(self) -> bool:
        """Whether places that were pressed are warmer for a while."""
        return self.load_rise != 0.0

    def in_fabric(self) -> PiezoEffect | None:
        return WarmLoad(self.load_rise, self.load_lasts_s) if self.load_rise else None

    def drift(self, time_s: Array) -> Array:
        return np.asarray(np.exp(self._log_drift(time_s)))

    def warmth(
        self, position_m: Array, time_s: Array, sensor: Sensor, protocol: Protocol
    ) -> tuple[Array, Array] | None:
        if not (self.gradient_x or self.gradient_y):
            return None
        low_m, high_m = sensor.extent_m
        place = (2.0 * np.asarray(position_m) - low_m - high_m) / (high_m - low_m)
        return -(place @ np.array([self.gradient_x, self.gradient_y])), self._log_drift(time_s)

    def _log_drift(self, time_s: Array) -> Array:
        hours = time_s / 3600.0
        settled = -self.settle_h * np.expm1(-hours / self.settle_h)
        phase = 2.0 * np.pi * hours / self.period_h
        swing = self.swing_sine * np.sin(phase) + self.swing_cosine * (np.cos(phase) - 1.0)
        return np.asarray(self.rate_per_h * settled + self.bend_per_h2 * hours**2 + swing)

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Log conductance of the sheet gained 300 s after the recording's start, in its middle."""
        return {"log_change_300_s": float(-np.log(self.drift(np.array([300.0]))[0]))}

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        """A drift that bends, rooms that settle quickly or slowly, rooms that swing."""
        bent = ("rate_per_h", "bend_per_h2")
        settling = (cls(settle_h=settle_h) for settle_h in (0.03, 0.3))
        swinging = (cls(period_h=period_h) for period_h in (0.1, 0.3))
        return (
            Start(cls(), bent, bent),
            *(Start(s, ("rate_per_h", "settle_h"), ("rate_per_h",)) for s in settling),
            *(Start(s, ("rate_per_h", *SWING, "period_h"), ("rate_per_h", *SWING)) for s in swinging),
        )

    def freer(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        """Uneven over the sheet; with a load that is warmer or colder than the sheet."""
        found = []
        if not set(GRADIENT) & set(free):
            found.append(Start(self, (*free, *GRADIENT)))
        if not set(LOAD) & set(free):
            found.append(Start(replace(self, load_rise=1e-3), (*free, *LOAD)))
        return tuple(found)
