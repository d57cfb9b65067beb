"""The fabric's resistance depends on whether the pressure rose or fell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numba import njit

from ertskin.physics.effects.effect import Array, PiezoEffect, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

EIGHTHS = np.array([-1.150, -0.319, 0.319, 1.150])
"""Where a standard normal distribution has 1, 3, 5 and 7 eighths below."""
WAYS_PA = 3e3, 2e4
"""Where fits of the pressure begin along which a lag is felt."""
SMALL = 1e-3
"""Change of pressure over the way, up to which a series of three terms is as good as the exponential."""


@dataclass(frozen=True)
class PiezoHysteresis(PiezoEffect):
    """A play operator with relative width: the law answers to x, dragged along by p(1-w) <= x <= p(1+w).

    With ``spread`` > 0 the mean of four plays (Prandtl-Ishlinskii): the turn from loading to unloading gets rounder.
    Their lags, the logarithm of p(1+w) over p(1-w), are quantiles of a log-normal distribution of the mean w's.

    With ``lag`` > 0 the law answers to x - e, de = lag dx - e |dx| / ``way_pa`` (Duhem's model as in Coleman and
    Hodgdon). Where the pressure has gone, some of it stays behind until the place is pressed again.
    """

    name: ClassVar[str] = "piezo_hysteresis"
    source: ClassVar[str] = (
        "Krasnosel'skii & Pokrovskii, Systems with Hysteresis (1989), ch. 1: generalised play; Coleman & Hodgdon, "
        "Int. J. Eng. Sci. 24 (1986) 897"
    )
    order: ClassVar[int] = 2
    form_error: ClassVar[float] = 0.09
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.HISTORY, Axis.FORCE), (Signal.READINGS, Signal.SPECIMEN), (Need.PRESSES,)
    )

    width: float = parameter("1", 0.0, 0.6, 0.0, 0.03, "half the loop's width over the pressure")
    spread: float = parameter("1", 0.0, 1.5, 0.0, 0.2, "standard deviation of the lags' logarithm", defining=False)
    lag: float = parameter("1", 0.0, 0.95, 0.0, 0.03, "share of a change of pressure that is felt only along the way")
    way_pa: float = parameter("Pa", 300.0, 3e5, 1e4, 1e3, "change of pressure along which it is felt", defining=False)

    @property
    def remembers_air(self) -> bool:
        """Whether a place that was pressed is not as before while nothing touches it."""
        return self.lag > 0

    def effective_pressure_pa(self, pressure_pa: Array, position_m: Array, time_s: Array, extent_m: Array) -> Array:
        felt = self._played(pressure_pa)
        return np.asarray(_along_the_way(felt, self.lag, self.way_pa)) if self.lag > 0 else felt

    def _played(self, pressure_pa: Array) -> Array:
        """(T,N) what the plays make of pressures (T,N)."""
        if self.spread == 0:
            return np.asarray(_play(pressure_pa, self.width))
        shares = np.exp(self.spread * EIGHTHS)
        parts = np.tanh(np.arctanh(self.width) * shares / shares.mean())
        return sum((_play(pressure_pa, w) for w in parts), np.zeros_like(pressure_pa)) / len(parts)

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Widest gap between the branches of a cycle to 0.8 of the specimen's stress, over the span of resistance."""
        pressure = standard.cycle_pa(0.8)[:, None]
        time_s = np.arange(len(pressure), dtype=float)
        felt = self.effective_pressure_pa(pressure, np.zeros((1, 2)), time_s, standard.extent_m)
        resistance = standard.resistance(felt[:, 0])
        return {"loop_width": float(np.abs(resistance - resistance[::-1]).max() / np.ptp(resistance))}

    @classmethod
    def specimen_starts(cls) -> tuple[Start, ...]:
        return (
            Start(cls(width=0.05), ("width",)),
            *(Start(cls(lag=0.2, way_pa=way_pa), ("lag", "way_pa")) for way_pa in WAYS_PA),
        )

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        lagging = (Start(cls(way_pa=way_pa), ("lag", "way_pa"), ("lag",)) for way_pa in WAYS_PA)
        return Start(cls(), ("width",), ("width",)), *lagging

    def freer(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        if free == ("lag",):
            return (Start(self, ("lag", "way_pa")),)
        return (Start(self.changed({"spread": self.spread or 0.3}), ("width", "spread")),) if free == ("width",) else ()


@njit(cache=True, nogil=True)
def _play(pressure_pa, width):  # type: ignore[no-untyped-def]
    effective = np.empty_like(pressure_pa)
    state = np.zeros(pressure_pa.shape[1])
    for t in range(pressure_pa.shape[0]):
        for n in range(pressure_pa.shape[1]):
            pressure = pressure_pa[t, n]
            reach = abs(pressure) * width
            state[n] = min(max(state[n], pressure - reach), pressure + reach)
            effective[t, n] = state[n]
    return effective


@njit(cache=True, nogil=True)
def _along_the_way(pressure_pa, lag, way_pa):  # type: ignore[no-untyped-def]
    """(T,N) what is felt of pressures (T,N). Most changes are of places hardly reached: a series is exact there."""
    felt = np.empty_like(pressure_pa)
    most_pa = lag * way_pa
    for n in range(pressure_pa.shape[1]):
        last, left = 0.0, 0.0
        for t in range(pressure_pa.shape[0]):
            pressure = pressure_pa[t, n]
            change = pressure - last
            if change != 0.0:
                part = abs(change) / way_pa
                gone = 1.0 - np.exp(-part) if part > SMALL else part * (1.0 - part * (0.5 - part / 6.0))
                left += ((most_pa if change > 0.0 else -most_pa) - left) * gone
                last = pressure
            felt[t, n] = max(pressure - left, 0.0)
    return felt
