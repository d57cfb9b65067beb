"""The amplifier or the converter compresses large readings, and clips the largest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numba import njit

from ertskin.physics.effects.effect import AcquisitionEffect, Array, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Measured, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

MOST_SHORT = 0.99
"""Most of what is beyond the straight part by which a reading of the level may fall short."""
KNEES = 0.5, 0.75
"""Parts of the level from which on readings may be bent alone."""
SHARPNESSES = 2.0, 5.0, 15.0
"""Where fits begin: the cubic curve of a symmetric stage that is overdriven a little, a bend, a knee."""

FAR = 1e200
"""Value of q |v/L|^n from which on a reading is where it stops; beyond it powers overflow."""

LAST_DIGIT = 1e-16
"""What, added to one, leaves it."""


@njit(cache=True, nogil=True)
def _bent(voltage_v, straight_v, level_v, bend, sharpness):  # type: ignore[no-untyped-def]
    """(N,) readings of voltages (N,), as ``AdcSaturation`` says; ``bend`` is q. Readings not taken are NaN and stay."""
    read_v = voltage_v.copy()
    span_v = level_v - straight_v
    # Below this a reading falls short by less than its last digit: most readings, of a knee.
    least_v = span_v * (LAST_DIGIT / bend) ** (1.0 / sharpness)
    for n in range(len(voltage_v)):
        beyond_v = abs(voltage_v[n]) - straight_v
        if not beyond_v > least_v:
            continue
        part = bend * (beyond_v / span_v) ** sharpness
        kept_v = beyond_v * (1.0 + part) ** (-1.0 / sharpness) if part < FAR else span_v * bend ** (-1.0 / sharpness)
        read_v[n] = straight_v + kept_v if voltage_v[n] > 0.0 else -straight_v - kept_v
    return read_v


@dataclass(frozen=True)
class AdcSaturation(AcquisitionEffect):
    """A reading v becomes v (1 + q |v/L|^n)^(-1/n), then stays between ``lowest_v`` and ``limit_v``.

    n is the ``sharpness``, L the ``level_v``, q such that a reading of L falls short by its part ``compression``: small
    ones fall short by the part q |v/L|^n / n, the largest approach L q^(-1/n). ``level_v`` isn't fitted. What is within
    the part ``straight_share`` of L stays as it is, and v and L count from there. What is smooth and alike on both
    sides of nought has no square of |v|, so n is two at least (Rapp's p, half of it, is one): all four limits named at
    an n of one were leaks, a common mode and absorbed charge (`experiments/concealed`). An exponential approach from a
    knee is then followed to within 3 % of what it takes off.
    """

    name: ClassVar[str] = "adc_saturation"
    source: ClassVar[str] = (
        "Full scale of a converter or the rail of the amplifier before it; the approach to it as in C. Rapp, Effects of"
        " HPA-nonlinearity on a 4-DPSK/OFDM signal, 2nd European Conference on Satellite Communications (1991) 179"
    )
    order: ClassVar[int] = 2
    form_error: ClassVar[float] = 0.2
    linear: ClassVar[bool] = False
    by_reading: ClassVar[bool] = True
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.ELECTRODE,), (Signal.NONRECIPROCAL,), (), measured=Measured.READING_LIMIT
    )

    limit_v: float = float("inf")
    lowest_v: float = float("-inf")
    compression: float = parameter("1", 0.0, 0.9, 0.0, 0.01, "part by which a reading of level_v falls short")
    sharpness: float = parameter(
        "1", 2.0, 60.0, 2.0, 1.0, "power of the reading with which that part grows", defining=False
    )
    straight_share: float = parameter(
        "1", 0.0, 0.95, 0.0, 0.1, "part of level_v up to which readings are straight", defining=False
    )
    level_v: float = 1.0

    def distorted_v(self, voltage_v: Array, protocol: Protocol) -> Array:
        return np.clip(self._compressed(voltage_v), self.lowest_v, self.limit_v)

    @property
    def _bend(self) -> float:
        """q of the class's formula."""
        short = min(self.compression / (1 - self.straight_share), MOST_SHORT)
        return float(np.expm1(-self.sharpness * np.log1p(-short)))

    def _compressed(self, voltage_v: Array) -> Array:
        if self.compression == 0:
            return voltage_v
        flat = np.ascontiguousarray(voltage_v, dtype=float).ravel()
        read = _bent(flat, self.straight_share * self.level_v, self.level_v, self._bend, self.sharpness)
        return np.asarray(read.reshape(np.shape(voltage_v)))

    @property
    def approached_v(self) -> float:
        """What no reading exceeds, in volt."""
        if self.compression == 0:
            return self.limit_v
        straight_v = self.straight_share * self.level_v
        return min(self.limit_v, straight_v + (self.level_v - straight_v) * self._bend ** (-1 / self.sharpness))

    def scaled_to(self, largest_v: float) -> Self:
        return self.changed({"level_v": largest_v})

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Where readings stop, if anywhere."""
        return {"limit_v": self.approached_v} if np.isfinite(self.approached_v) else {}

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        both = ("compression", "sharpness")
        return tuple(Start(cls(compression=0.01, sharpness=one), both, both[:1]) for one in SHARPNESSES)

    def freer(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        """With a straight part below the bend, which is rounder then."""
        if "straight_share" in free:
            return ()
        rounder = ({"straight_share": knee, "sharpness": 2.0} for knee in KNEES)
        return tuple(Start(self.changed(form), (*free, "straight_share")) for form in rounder)
