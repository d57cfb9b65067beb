"""Families in no list, third batch: filters, clocks and switches that are late or early, and amplifiers too slow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .families_instrument import _rest_transfer
from .simulate import frames_of
from .skin import Skin
from .unlisted import Unlisted

Array = NDArray[np.float64]


class AveragingFilter(Unlisted):
    """The reader's running average was left on: every scan holds something of those before. Size is what half a second
    leaves of it."""

    name, source, largest = "averaging_filter", "Smith, Guide to Digital Signal Processing, 1997, ch. 15 and 19", 0.9

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.since_s = np.diff(frames_of(skin).time_s, prepend=0.0)

    def recorded(self, voltage_v: Array, moving: NDArray[np.bool_], rng: np.random.Generator) -> Array:
        out = voltage_v.copy()
        for i, kept in enumerate(self.size ** (self.since_s / 0.5)):
            if i > 0:
                out[i] += kept * (out[i - 1] - out[i])
        return out


class DriftingClock(Unlisted):
    """The reader's clock runs slow beside the stage's: scans are of an ever earlier moment than they are put down for.
    Size is how late (s) it is in the end."""

    name, source, largest = "drifting_clock", "Mills, IEEE Trans. Commun. 39, 1991: clocks left alone", 10.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.time_s = frames_of(skin).time_s

    def recorded(self, voltage_v: Array, moving: NDArray[np.bool_], rng: np.random.Generator) -> Array:
        really_s = self.time_s * (1.0 - self.size / self.time_s[-1])
        at = np.interp(really_s, self.time_s, np.arange(len(self.time_s)))
        before = np.floor(at).astype(int)
        part, after = (at - before)[:, None, None], np.minimum(before + 1, len(at) - 1)
        return np.asarray((1.0 - part) * voltage_v[before] + part * voltage_v[after])


class EarlySwitch(Unlisted):
    """The source goes over to the next pair before the last channels have been read: they hold some of what comes."""

    name, source, largest = "early_switch", "Analog Devices MT-088: break before make and timing of multiplexers", 0.9

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.reach = rng.uniform(1.5, 4.0)

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        out, left = voltage_v.copy(), np.arange(voltage_v.shape[1])[::-1]
        out[:-1] += self.size * np.exp(-left / self.reach) * (voltage_v[1:] - voltage_v[:-1])
        return out


class SlewLimit(Unlisted):
    """The amplifier swings only so fast: from one reading to the next it gets no farther than a step."""

    name, source = "slew_limit", "Solomon, IEEE J. Solid-State Circuits 9, 1974: slew rate of operational amplifiers"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        protocol = skin.protocol
        self.taken = np.ones(protocol.weights.shape[:2], bool) if protocol.measured is None else protocol.measured
        at_rest = protocol.readings(_rest_transfer(skin))[self.taken]
        self.most_v = float(np.max(np.abs(np.diff(at_rest))))

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        step, out, wanted = 1.01 * self.most_v * float(np.exp(-self.size)), voltage_v.copy(), voltage_v[self.taken]
        reached, last = np.empty_like(wanted), float(wanted[0])
        for i, there in enumerate(wanted.tolist()):
            last = min(max(there, last - step), last + step)
            reached[i] = last
        out[self.taken] = reached
        return out


KINDS: tuple[type[Unlisted], ...] = (
    AveragingFilter,
    DriftingClock,
    EarlySwitch,
    SlewLimit,
)
