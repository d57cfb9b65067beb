"""The bench's piezoresistive pair: a closing law, a log-domain Prandtl-Ishlinskii memory, a log-time creep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ClosingLaw:
    """R = floor + (zero - floor) (1 - p/closing)^exponent: gaps between the fabrics close one after another.

    Constant beyond ``closing_pa``. A power that is no whole number is no polynomial, yet a fifth-order one follows it
    to 3e-4 of its value for exponents from 3.6 to 4.8: the baseline's form can fit the specimen.
    """

    zero_ohm: float
    floor_ohm: float
    closing_pa: float
    exponent: float

    def resistance_ohm(self, pressure_pa: Array) -> Array:
        """Sheet resistance (ohm per square) under a pressure; a negative one counts as none."""
        open_share = 1.0 - np.clip(pressure_pa / self.closing_pa, 0.0, 1.0)
        return self.floor_ohm + (self.zero_ohm - self.floor_ohm) * open_share**self.exponent


@dataclass(frozen=True)
class WedgeMemory:
    """One-sided plays in the logarithm of pressure, spread exponentially: loading is virgin, unloading lags.

    A Prandtl-Ishlinskii operator (Krejci, Hysteresis, Convexity and Dissipation, 1996) in log(p + offset), so loops
    close at zero pressure. ``width`` is the mean lag in log-pressure of a long unloading.
    """

    width: float
    offset_pa: float = 1.0
    shares: tuple[float, ...] = (0.30, 0.25, 0.20, 0.15, 0.10)
    lags: tuple[float, ...] = (0.35, 0.70, 1.10, 1.60, 2.60)

    def start(self, shape: tuple[int, ...]) -> Array:
        """State of a virgin pair, (plays, *shape)."""
        return np.full((len(self.lags), *shape), np.log(self.offset_pa))

    def follow(self, state: Array, pressure_pa: Array) -> tuple[Array, Array]:
        """(new state, effective pressure) after moving monotonically to ``pressure_pa``."""
        y = np.log(np.maximum(pressure_pa, 0.0) + self.offset_pa)
        mean_lag = float(np.dot(self.shares, self.lags))
        lag = self.width / mean_lag * np.array(self.lags).reshape(-1, *(1,) * y.ndim)
        new = np.maximum(y, np.minimum(state, y + lag))
        return new, np.exp(np.tensordot(self.shares, new, axes=1)) - self.offset_pa


@dataclass(frozen=True)
class LogCreep:
    """The pair keeps closing under constant pressure, about as the logarithm of time.

    A ladder of first-order steps, equally strong and spread by decades; ``per_decade`` is the loss of resistance per
    decade of time at full contact, and contact is half full at ``half_pa``.
    """

    per_decade: float
    half_pa: float = 6e3
    times_s: tuple[float, ...] = (1.0, 3.2, 10.0, 32.0, 100.0)

    def start(self, shape: tuple[int, ...]) -> Array:
        """State of a pair long at rest, (steps, *shape)."""
        return np.zeros((len(self.times_s), *shape))

    def dwell(self, state: Array, pressure_pa: Array, seconds: float) -> Array:
        """State after ``seconds`` at constant pressure."""
        held = np.maximum(pressure_pa, 0.0)
        contact = held / (held + self.half_pa)
        fade = np.exp(-seconds / np.array(self.times_s)).reshape(-1, *(1,) * contact.ndim)
        return contact + (state - contact) * fade

    def factor(self, state: Array) -> Array:
        """What the resistance is multiplied by."""
        return 1.0 - 0.5 * self.per_decade * state.sum(axis=0)
