"""Families in no list, second batch: wires, currents and converters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .effect import Moment
from .sheet import Sheet
from .skin import Skin
from .unlisted import Unlisted

Array = NDArray[np.float64]


class _Potentials(Unlisted):
    """What needs to know the electrodes' potentials; kept from the network for the readings taken through it."""

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.protocol, self.transfer = skin.protocol, np.zeros((0, 0))

    def network(self, transfer_ohm: Array, moment: Moment) -> Array:
        self.transfer = transfer_ohm
        return transfer_ohm

    def read(self, potential_v: Array) -> Array:
        """(K,M) readings of potentials (K,L)."""
        return np.asarray(np.einsum("kml,kl->km", self.protocol.weights, potential_v))

    def from_sink(self) -> Array:
        """(K,L) potentials of the electrodes over the sink's."""
        potential = self.protocol.current @ self.transfer
        return np.asarray(potential - potential[np.arange(len(potential)), self.protocol.injection[:, 1]][:, None])

    def drained(self, share: Array, siemens: float) -> Array:
        """(K,M) what readings lose if a shunt leads from the electrodes, by their shares (L,), to the sink."""
        current = self.protocol.current
        way = np.zeros_like(current)
        way += share
        way[np.arange(len(way)), self.protocol.injection[:, 1]] -= 1.0
        through = way @ self.transfer
        lost = siemens * (through * current).sum(axis=1) / (1.0 + siemens * (through * way).sum(axis=1))
        return self.read(lost[:, None] * through)


class OffLeakage(_Potentials):
    """Open switches leak: electrodes next to a driven one in the multiplexer's order are drawn towards it."""

    name, source, largest = "mux_off_leakage", "Analog Devices MT-088: leakage of open switches", 0.3

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        potential = self.protocol.current @ self.transfer
        drawn, rows, count = np.zeros_like(potential), np.arange(len(potential)), potential.shape[1]
        for driven, other in (self.protocol.injection.T, self.protocol.injection.T[::-1]):
            for beside in ((driven - 1) % count, (driven + 1) % count):
                free = beside != other
                at = rows[free], beside[free]
                drawn[at] += potential[rows[free], driven[free]] - potential[at]
        return voltage_v + self.size * self.read(drawn)


class GroundedShield(_Potentials):
    """One electrode's shield touches earth, as the sink does: part of every current leaves there."""

    name, source = "grounded_shield", "Ott, Electromagnetic Compatibility Engineering, 2009, ch. 3"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        super().draw(skin, rng)
        self.electrode, self.siemens = int(rng.integers(skin.protocol.electrodes)), 0.5 / skin.sheet_ohm
        self.details["electrode"] = self.electrode

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        return voltage_v - self.drained(np.eye(self.protocol.electrodes)[self.electrode], self.size * self.siemens)


class InputBias(_Potentials):
    """The amplifiers' inputs draw currents of their own through the skin, whichever pair is driven."""

    name, source, largest = "input_bias", "Horowitz and Hill, The Art of Electronics, ch. 4: bias currents", 0.3

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        super().draw(skin, rng)
        bias = rng.standard_normal(skin.protocol.electrodes)
        self.bias_a = skin.protocol.current_a * (bias - bias.mean()) / np.sqrt(len(bias))

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        potential = self.size * self.bias_a @ self.transfer
        return voltage_v + self.read(np.broadcast_to(potential, self.protocol.current.shape))


class PolarisedElectrodes(_Potentials):
    """Driven electrodes charge up like double layers and keep it for some injections; the layers form with time."""

    name, source, largest = "polarised_electrodes", "Geddes, Electrodes and Bioelectric Events, 1972, ch. 1", 0.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        super().draw(skin, rng)
        strength, kept = rng.uniform(0.3, 1.5, skin.protocol.electrodes), rng.uniform(0.5, 0.85)
        given = strength * skin.protocol.current / skin.protocol.current_a
        charge = np.zeros_like(given)
        for k in range(1, len(given)):
            charge[k] = kept * (charge[k - 1] + given[k - 1])
        self.pattern = self.read(charge)

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        return voltage_v + self.size * (1.0 - 0.6 * np.exp(-time_s / 150.0)) * self.pattern


def _rest_transfer(skin: Skin) -> Array:
    """Transfer matrix of the skin at rest, on a coarse mesh."""
    sheet = Sheet(skin.outline_m, skin.electrodes, replace(skin.fineness, far_m=3.5e-3, rim_m=9e-4))
    specific = 1.0 / (skin.contact_ohm * skin.electrodes.extent)
    admittance = np.where(sheet.pad >= 0, specific[sheet.pad] if skin.electrodes.edge_m is None else 0.0, 0.0)
    shape = sheet.weight.shape
    return sheet.transfer(np.full(shape, 1.0 / skin.sheet_ohm), np.broadcast_to(admittance[:, None], shape), specific)


class ComplianceLimit(_Potentials):
    """The current source runs out of voltage: where the skin resists most, less current goes in than is said."""

    name, source = "compliance_limit", "Franco, Operational Amplifiers, 2015, section 2.2: voltage compliance"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        super().draw(skin, rng)
        self.most_v = float(np.max(self._needed(_rest_transfer(skin))))

    def _needed(self, transfer_ohm: Array) -> Array:
        """(K,) voltage from source to sink for the whole current."""
        i, j = self.protocol.injection.T
        ohm = transfer_ohm[i, i] + transfer_ohm[j, j] - 2 * transfer_ohm[i, j]
        return np.asarray(self.protocol.current_a * ohm)

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        there_v = 1.01 * self.most_v * np.exp(-0.7 * self.size)
        return np.asarray(voltage_v * np.minimum(there_v / self._needed(self.transfer), 1.0)[:, None])


class ReferenceStep(Unlisted):
    """At some moment the converter's reference jumps: every reading is larger by the same share from then on."""

    name, source, largest = "reference_step", "Linear Technology AN82, 1999: voltage references", 0.2

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.after_s = rng.uniform(0.35, 0.65) * skin.plan.duration_s

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        return voltage_v * (1.0 + self.size) if time_s > self.after_s else voltage_v


class WeakBit(Unlisted):
    """One of the converter's bits weighs less than it should; at size 1 it is stuck at nought."""

    name, source = "weak_bit", "Kester, Data Conversion Handbook, 2005, ch. 2: differential non-linearity"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.step_v = skin.protocol.adc_volts_per_count * 2 ** int(rng.integers(9, 12))

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        return np.asarray(voltage_v - self.size * self.step_v * (np.floor(voltage_v / self.step_v) % 2))


class MainsBeat(Unlisted):
    """Readings are no whole mains periods long: hum is left, a slow beat that channels take up unevenly."""

    name, source, largest = "mains_beat", "Keithley, Low Level Measurements, 2013: line-cycle integration", 0.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        columns = len(skin.protocol.read) if skin.protocol.read is not None else skin.protocol.electrodes
        self.taken, self.phase = rng.uniform(0.3, 1.5, columns), rng.uniform(0, 2 * np.pi)
        self.hertz, self.offset_s = rng.uniform(1.0, 6.0), skin.protocol.offset_s - 0.5 * skin.protocol.scan_s

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        hum = np.sin(2 * np.pi * self.hertz * (time_s + self.offset_s) + self.phase)
        return voltage_v + self.size * np.outer(hum, self.taken)


KINDS: tuple[type[Unlisted], ...] = (
    OffLeakage,
    GroundedShield,
    InputBias,
    PolarisedElectrodes,
    ComplianceLimit,
    ReferenceStep,
    WeakBit,
    MainsBeat,
)
