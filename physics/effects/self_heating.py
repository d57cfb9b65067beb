"""The scan's own currents warm the sheet while it is read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import AcquisitionEffect, Array, Stage, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor


@dataclass(frozen=True)
class SelfHeating(AcquisitionEffect):
    """Sheet resistance times exp(``rise`` w), w the warmth that a scan's injections before a reading have left.

    Every injection adds its share of the scan's dissipated power, as the square of its current: an even sheet's pair
    resistances differ by the logarithm of their distance only. The warmth leaks away with a time constant of
    ``settle_scans`` scans, and is one where the scan's mean power has gone on for long; between scans the sheet cools.
    As every injection meets another sheet, no one resistor network explains the readings.
    """

    name: ClassVar[str] = "self_heating"
    stage: ClassVar[Stage] = Stage.CONDUCTION
    source: ClassVar[str] = (
        "Newton's law of cooling with Joule's heat; PPy-coated fabric changes by about -0.6 %/K, and a milliwatt on a "
        "square centimetre of it warms it by kelvins"
    )
    order: ClassVar[int] = -1
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.SCAN_ORDER, Axis.TIME), (Signal.NONRECIPROCAL,), (Need.MORE_READINGS,)
    )

    rise: float = parameter("1", -0.2, 0.2, 0.0, 1e-3, "logarithm of the resistance, warm through against cold")
    settle_scans: float = parameter(
        "1", 0.02, 10.0, 0.5, 0.1, "time constant of the warmth over the time that a scan takes", defining=False
    )

    def distorted_v(self, voltage_v: Array, protocol: Protocol) -> Array:
        return np.asarray(voltage_v * np.exp(self.rise * self.warmth(protocol))[:, None])

    def warmth(self, protocol: Protocol) -> Array:
        """(K,) when each injection is read, of a sheet that was cold when the scan began."""
        power = (protocol.injection_current_a**2).sum(axis=1)
        moment, last = _moments(protocol)
        lasted = np.diff(moment, append=last)
        warm = np.zeros(len(power))
        for k in range(1, len(power)):
            kept = np.exp(-lasted[k - 1] / self.settle_scans)
            warm[k] = kept * warm[k - 1] + (1 - kept) * power[k - 1] / power.mean()
        return warm

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        """Warmth that settles early in a scan, over it, and long after."""
        return tuple(Start(cls(1e-3, scans), ("rise", "settle_scans"), ("rise",)) for scans in (0.1, 0.5, 3.0))


def _moments(protocol: Protocol) -> tuple[Array, float]:
    """(K,) when each injection begins and when the last one ends, in scans; evenly spread where that isn't known."""
    count = protocol.shape[0]
    if protocol.injection_offset_s is None:
        return np.arange(count) / count, 1.0
    offset_s = np.asarray(protocol.injection_offset_s, dtype=float) - np.min(protocol.injection_offset_s)
    scan_s = float(offset_s.max()) * count / max(count - 1, 1)
    return (offset_s / scan_s, 1.0) if scan_s > 0 else (np.arange(count) / count, 1.0)
