"""What the instrument does to readings: gains, memory of the multiplexer, limits, a stage that doesn't wait."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .effect import Effect, Moment
from .skin import Skin

Array = NDArray[np.float64]


class GainAndOffset(Effect):
    """One channel's amplifier has another gain, and an offset."""

    name, form, source = "channel_gain", "gain_and_offset", "Horowitz and Hill, The Art of Electronics, ch. 5"
    largest = 0.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        read = skin.protocol.read
        self.channel = int(rng.integers(len(read) if read is not None else skin.protocol.electrodes))
        self.sign, self.offset_v = rng.choice([-1.0, 1.0]), rng.uniform(-0.5, 0.5)
        self.details["channel"] = self.channel

    def gain_at(self, time_s: float) -> float:
        """Gain less one."""
        return float(self.size * self.sign)

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        voltage_v = voltage_v.copy()
        voltage_v[:, self.channel] *= 1.0 + self.gain_at(time_s)
        voltage_v[:, self.channel] += self.size * self.offset_v
        return voltage_v

    def meaning(self, skin: Skin) -> dict[str, float]:
        return {"gain_less_one": self.gain_at(200.0)}


class WarmingGain(GainAndOffset):
    """The gain comes in as the amplifier warms up."""

    form, source = "warming_gain", "Horowitz and Hill, ch. 5: gain drift of resistor networks"

    def gain_at(self, time_s: float) -> float:
        return float(self.size * self.sign * (0.4 - 0.6 * np.expm1(-time_s / 120.0)))


class SettlingMultiplexer(Effect):
    """The multiplexer's capacitor keeps part of the last channel's voltage; it is emptied when an injection begins.

    It settles through the switch and the electrode's own contact: channels differ.
    """

    name, form = "crosstalk", "rc_per_injection"
    source = "Analog Devices MT-088: settling of multiplexed converters"
    largest = 0.6

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        ohm = skin.contact_ohm / np.median(skin.contact_ohm)
        columns = len(skin.protocol.read) if skin.protocol.read is not None else skin.protocol.electrodes
        self.slow = 0.6 + 0.4 * np.resize(ohm, columns)

    def kept(self) -> Array:
        """(M,) share of the voltage before that a channel keeps."""
        return (
            np.asarray(np.exp(np.log(max(self.size, 1e-12)) / self.slow)) if self.size > 0 else np.zeros(len(self.slow))
        )

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        out, before = voltage_v.copy(), np.zeros(len(voltage_v))
        for m, kept in enumerate(self.kept()):
            out[:, m] = voltage_v[:, m] + kept * (before - voltage_v[:, m])
            before = out[:, m]
        return out

    def meaning(self, skin: Skin) -> dict[str, float]:
        return {"share_kept": float(np.mean(self.kept()))}


class SoakingDielectric(SettlingMultiplexer):
    """The hold capacitor's dielectric gives back parts of the last three voltages, across injections too."""

    form, source = "dielectric_absorption", "Pease, EDN 13 Oct 1982: understand capacitor soakage"

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        flat = voltage_v.ravel()
        padded = np.concatenate([np.full(3, flat[0]), flat])
        share = self.size * np.array([0.6, 0.28, 0.12])
        late = sum(s * padded[3 - n - 1 : len(padded) - n - 1] for n, s in enumerate(share))
        return np.asarray((1.0 - self.size) * flat + late).reshape(voltage_v.shape)

    def meaning(self, skin: Skin) -> dict[str, float]:
        return {"share_kept": float(0.6 * self.size)}


class HardLimit(Effect):
    """The converter's reference is low: it stops at a voltage below what its maker says."""

    name, form, source = "adc_saturation", "hard", "Kester, Data Conversion Handbook, 2005, ch. 2"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        # No reading of the skin is as large as this: pads spread their current over a few squares of sheet.
        current = float(np.max(skin.protocol.current))
        self.top_v = current * (6.0 * skin.sheet_ohm + 2.0 * float(np.max(skin.contact_ohm)))

    @property
    def limit_v(self) -> float:
        """Where it stops."""
        return float(self.top_v * np.exp(-5.0 * self.size))

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        return np.clip(voltage_v, -self.limit_v, self.limit_v)

    def meaning(self, skin: Skin) -> dict[str, float]:
        return {"limit_v": self.limit_v}


class SoftLimit(HardLimit):
    """An amplifier near its supply gives way over a tenth of a volt or so before it stops."""

    form, source = "soft_knee", "Rapp, ESA SP-332, 1991: compression with a knee"

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        power = 14.0
        return np.asarray(voltage_v / (1.0 + np.abs(voltage_v / self.limit_v) ** power) ** (1.0 / power))


class RunningStage(Effect):
    """The stage goes on towards its next depth while a scan is taken, easing in and out."""

    name, form, source = "scan_skew", "s_curve", "Biagiotti and Melchiorri, Trajectory Planning, 2008, ch. 3"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.scan_s = skin.protocol.scan_s
        steps = [press.step_s for press in skin.plan.presses]
        self.ratio = self.scan_s / float(np.median(steps))

    def way(self, share: float) -> float:
        """Part of the step made at a share (0 to 1) of the time to the next frame."""
        return share**2 * (3.0 - 2.0 * share)

    def moved(self, moments: list[Moment]) -> list[Moment]:
        out: list[Moment] = []
        for now, after in zip(moments, [*moments[1:], None], strict=True):
            following = after is not None and len(after.depth_m) == len(now.depth_m) and len(now.depth_m) > 0
            if not following or np.array_equal(after.depth_m, now.depth_m):  # type: ignore[union-attr]
                out.append(now)
                continue
            step = after.depth_m - now.depth_m  # type: ignore[union-attr]
            for within in (0.02, 0.5, 0.98):
                time = now.time_s + (within - 0.5) * self.scan_s
                share = self.way(min(within * self.ratio, 1.0))
                out.append(replace(now, time_s=time, depth_m=now.depth_m + self.size * share * step, within=within))
        steps = np.diff([out[0].time_s, *(m.time_s for m in out)])
        return [replace(m, since_s=float(max(s, 0.0))) for m, s in zip(out, steps, strict=True)]

    def meaning(self, skin: Skin) -> dict[str, float]:
        return {"share_of_step_in_scan": self.size * self.way(min(self.ratio, 1.0))}


class LaggingStage(RunningStage):
    """A belt-driven stage nears its command exponentially and is late at every frame."""

    form, source = "first_order_lag", "Åström and Murray, Feedback Systems, 2008, ch. 5"

    def way(self, share: float) -> float:
        return float(-np.expm1(-2.5 * share) / -np.expm1(-2.5))
