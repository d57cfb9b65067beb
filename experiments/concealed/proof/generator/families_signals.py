"""Families in no list, third batch: grounds, sources, address lines and words that arrive changed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from .simulate import LOADING, UNLOADING, frames_of
from .skin import Skin
from .unlisted import Unlisted, _deepest_m

Array = NDArray[np.float64]


class MotorGround(Unlisted):
    """The stage's motor and the amplifiers share a ground wire: its current shifts channels, one more than another, by
    how it drives and how hard."""

    name, source, largest = "motor_ground", "Ott, Electromagnetic Compatibility Engineering, 2009, ch. 3", 0.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        columns, frames = skin.protocol.weights.shape[1], frames_of(skin)
        drive = np.where(frames.phase == LOADING, 1.0, np.where(frames.phase == UNLOADING, -0.6, 0.3))
        deep = np.nan_to_num(frames.depth_m).max(axis=1)
        self.taken, self.current = rng.uniform(0.2, 1.5, columns), drive * (deep > 0) * (0.4 + deep / _deepest_m(skin))

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        return voltage_v + self.size * self.current[frame] * self.taken


class WeakAddressLine(Unlisted):
    """One of the multiplexer's address lines doesn't quite reach its level: where it is up, the channel that has it
    down is half on as well."""

    name, source = "weak_address_line", "Horowitz and Hill, The Art of Electronics, ch. 12: logic levels"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        channel = np.arange(skin.protocol.weights.shape[1])
        # The lowest line would join a channel to the one before it.
        line = 2 ** int(rng.integers(1, int(np.log2(len(channel) - 1)) + 1))
        self.up = channel[(channel & line) > 0]
        self.down = self.up - line

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        out = voltage_v.copy()
        out[:, self.up] += 0.5 * self.size * (voltage_v[:, self.down] - voltage_v[:, self.up])
        return out


class UnsteadySource(Unlisted):
    """The current source flickers: all readings of an injection are too large or too small together."""

    name, source, largest = "unsteady_source", "Hooge, Kleinpenning and Vandamme, Rep. Prog. Phys. 44, 1981", 0.3

    def recorded(self, voltage_v: Array, moving: NDArray[np.bool_], rng: np.random.Generator) -> Array:
        kick = rng.standard_normal(voltage_v.shape[0] * voltage_v.shape[1])
        flicker = lfilter([np.sqrt(1.0 - 0.8**2)], [1.0, -0.8], kick).reshape(voltage_v.shape[:2])
        return np.asarray(voltage_v * (1.0 + self.size * flicker[..., None]))


class FlippedBits(Unlisted):
    """On a bad line a bit of some words arrives turned over. Size is the share of words."""

    name, source, largest = "flipped_bits", "Shannon, Bell Syst. Tech. J. 27, 1948: a noisy binary channel", 0.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.bit_v = skin.protocol.adc_volts_per_count * 2 ** int(rng.integers(8, 10))

    def recorded(self, voltage_v: Array, moving: NDArray[np.bool_], rng: np.random.Generator) -> Array:
        hit = rng.random(voltage_v.shape) < self.size
        turned = self.bit_v * (1.0 - 2.0 * (np.floor(voltage_v / self.bit_v) % 2))
        return np.asarray(voltage_v + np.where(hit, turned, 0.0))


KINDS: tuple[type[Unlisted], ...] = (
    MotorGround,
    WeakAddressLine,
    UnsteadySource,
    FlippedBits,
)
