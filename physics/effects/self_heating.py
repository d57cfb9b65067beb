"""The scan's own currents warm the sheet while it is read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.conduction.dissipation import heat_at
from ertskin.physics.effects.effect import AcquisitionEffect, Array, SheetEffect, Stage, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

WARMED_S = 300.0
"""How long scans go on until the warmth that is stated is taken."""


@dataclass(frozen=True)
class SelfHeating(SheetEffect, AcquisitionEffect):
    """Warmth that comes within a scan, and warmth that stays from scan to scan.

    Within a scan: sheet resistance times exp(``rise`` w), w the warmth that its injections before a reading have left.
    Every injection adds its share of the scan's dissipated power, as the square of its current: an even sheet's pair
    resistances differ by the logarithm of their distance only. The warmth leaks away with a time constant of
    ``settle_scans`` scans, and is one where the scan's mean power has gone on for long; between scans the sheet cools.
    As every injection meets another sheet, no one resistor network explains the readings.

    From scan to scan: sheet resistance times exp(``crowded_rise`` h(x) w(t)), h the power density of a scan over its
    mean over the sheet, spread sideways by ``spread_m``, w the warmth of the scans so far, each of which leaves as much
    and loses it with the time constant ``lasts_s``: one where scans have followed at their usual pace for long.
    """

    name: ClassVar[str] = "self_heating"
    stage: ClassVar[Stage] = Stage.CONDUCTION
    source: ClassVar[str] = (
        "Newton's law of cooling with Joule's heat; PPy-coated fabric changes by about -0.6 %/K, and a milliwatt on a "
        "square centimetre of it warms it by kelvins"
    )
    order: ClassVar[int] = -1
    # What the best fit leaves of the proof's forms: 0.21 and 0.24 (experiments/concealed/proof/isolated_laws.json).
    form_error: ClassVar[float] = 0.2
    form_error_at_rest: ClassVar[float] = 0.2
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.SCAN_ORDER, Axis.TIME), (Signal.NONRECIPROCAL, Signal.READINGS, Signal.REST), (Need.MORE_READINGS,)
    )

    rise: float = parameter("1", -0.2, 0.2, 0.0, 1e-3, "logarithm of the resistance, warm through against cold")
    settle_scans: float = parameter(
        "1", 0.02, 10.0, 0.5, 0.1, "time constant of the warmth over the time that a scan takes", defining=False
    )

    crowded_rise: float = parameter(
        "1", -1.0, 1.0, 0.0, 1e-3, "logarithm of the resistance, warm through against cold, where the mean power flows"
    )
    lasts_s: float = parameter(
        "s", 0.5, 3600.0, 30.0, 5.0, "time constant of the warmth that stays from scan to scan", defining=False
    )
    spread_m: float = parameter("m", 1e-3, 0.03, 2e-3, 1e-3, "how far heat spreads sideways", defining=False)

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Without what comes within a scan every reading of it is that of one network."""
        within = self.rise != 0 or self.crowded_rise == 0
        return tuple(s for s in self.hypothesis.signals if within or s != Signal.NONRECIPROCAL)

    def distorted_v(self, voltage_v: Array, protocol: Protocol) -> Array:
        return np.asarray(voltage_v * np.exp(self.rise * self.within_scan(protocol))[:, None])

    def within_scan(self, protocol: Protocol) -> Array:
        """(K,) when each injection is read, of a sheet that was cold when the scan began."""
        power = (protocol.injection_current_a**2).sum(axis=1)
        moment, last = _moments(protocol)
        lasted = np.diff(moment, append=last)
        warm = np.zeros(len(power))
        for k in range(1, len(power)):
            kept = np.exp(-lasted[k - 1] / self.settle_scans)
            warm[k] = kept * warm[k - 1] + (1 - kept) * power[k - 1] / power.mean()
        return warm

    def warmth(
        self, position_m: Array, time_s: Array, sensor: Sensor, protocol: Protocol
    ) -> tuple[Array, Array] | None:
        pattern = self.warm_through(position_m, sensor, protocol)
        return None if pattern is None else (pattern, self.course(time_s))

    def warm_through(self, position_m: Array, sensor: Sensor, protocol: Protocol) -> Array | None:
        if self.crowded_rise == 0.0:
            return None
        return np.asarray(-self.crowded_rise * heat_at(position_m, sensor, protocol, self.spread_m))

    def course(self, time_s: Array) -> Array:
        """(T,) warmth of the scans at ``time_s`` (T,) so far, that of the scan itself among them."""
        step_s = np.maximum(np.diff(time_s), 0.0)
        if not step_s.any():
            return np.zeros(len(time_s))
        pace_s, kept = float(np.median(step_s[step_s > 0])), np.exp(-step_s / self.lasts_s)
        each = -np.expm1(-pace_s / self.lasts_s)
        warm = np.full(len(time_s), each)
        for t in range(1, len(warm)):
            warm[t] += kept[t - 1] * warm[t - 1]
        return warm

    def quantities(self, standard: Standard) -> dict[str, float]:
        """What 300 s of scans at their usual pace make of a cold sheet's resistance, mean over the sheet; none where
        nothing stays from scan to scan."""
        if self.crowded_rise == 0.0:
            return {}
        return {"warmed_300_s": -float(self.crowded_rise * np.expm1(-WARMED_S / self.lasts_s))}

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        """Warmth that settles early in a scan, over it, and long after; warmth that stays, for three times as long."""
        within = tuple(Start(cls(1e-3, scans), ("rise", "settle_scans"), ("rise",)) for scans in (0.1, 0.5, 3.0))
        return within + tuple(
            Start(cls(lasts_s=lasts_s), ("crowded_rise", "lasts_s"), ("crowded_rise",), reciprocal=True)
            for lasts_s in (5.0, 30.0, 200.0)
        )

    def freer(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        """How far heat spreads, where it stays from scan to scan."""
        return (Start(self, (*free, "spread_m")),) if "lasts_s" in free and "spread_m" not in free else ()


def _moments(protocol: Protocol) -> tuple[Array, float]:
    """(K,) when each injection begins and when the last one ends, in scans; evenly spread where that isn't known."""
    count = protocol.shape[0]
    if protocol.injection_offset_s is None:
        return np.arange(count) / count, 1.0
    offset_s = np.asarray(protocol.injection_offset_s, dtype=float) - np.min(protocol.injection_offset_s)
    scan_s = float(offset_s.max()) * count / max(count - 1, 1)
    return (offset_s / scan_s, 1.0) if scan_s > 0 else (np.arange(count) / count, 1.0)
