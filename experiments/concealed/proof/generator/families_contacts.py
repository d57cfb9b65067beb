"""Families in no list, third batch: electrodes, their stitches, plugs and cables, and what leaks past them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .effect import Moment
from .electrodes import _centers
from .families_instrument import _Potentials
from .simulate import frames_of
from .skin import Skin
from .unlisted import Unlisted, _deepest_m

Array = NDArray[np.float64]


class RectifyingContact(_Potentials):
    """One electrode's oxide lets current out badly: as a sink it drops more voltage, and the source gives less."""

    name, source = "rectifying_contact", "Mott, Proc. R. Soc. A 171, 1939: contacts that rectify"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        super().draw(skin, rng)
        sink = skin.protocol.injection[:, 1]
        self.electrode = int(sink[int(rng.integers(len(sink)))])
        self.drop_v = skin.protocol.current_a * float(np.median(skin.contact_ohm))
        self.details["electrode"] = self.electrode

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        blocked = self.protocol.injection[:, 1] == self.electrode
        dropped = np.zeros((len(voltage_v), self.protocol.electrodes))
        dropped[blocked, self.electrode] = -self.size * self.drop_v
        return voltage_v * np.where(blocked, 1.0 - 0.6 * self.size, 1.0)[:, None] + self.read(dropped)


class StrainingStitches(Unlisted):
    """A press pulls at the stitches of the electrodes about it: on the side towards it the cloth is strained and
    conducts worse while it pulls."""

    name, source, largest = "straining_stitches", "Linz et al., Proc. IEEE ISWC 2005: embroidered contacts", 4.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.center_m, self.deep_m = _centers(skin.electrodes), _deepest_m(skin)
        self.weak = rng.uniform(0.2, 1.0, len(self.center_m))

    def sheet(self, point_m: Array, moment: Moment) -> Array | None:
        if not len(moment.position_m):
            return None
        total = np.zeros(len(point_m))
        for place, depth in zip(moment.position_m, moment.depth_m, strict=True):
            away = place - self.center_m
            distance = np.hypot(*away.T)
            pull = self.weak * (depth / self.deep_m) ** 2 * np.exp(-((distance / 0.03) ** 2))
            torn_m = self.center_m + 0.004 * away / (distance[:, None] + 1e-9)
            for at in np.flatnonzero(pull > 1e-4):
                total += pull[at] * np.exp(-((point_m - torn_m[at]) ** 2).sum(axis=1) / 0.004**2)
        return np.asarray(-self.size * total)


class SlowCables(_Potentials):
    """Cables hold charge: an electrode behind much resistance still stands where the injection before left it. Size is
    what is left at an electrode of usual resistance."""

    name, source, largest = "slow_cables", "Keithley, Low Level Measurements, 2013: settling by shunt capacitance", 0.7

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        if self.size == 0.0:
            return voltage_v
        potential = self.from_sink()
        ohm = np.diag(self.transfer)
        kept, stands = self.size ** (np.median(ohm) / ohm), potential.copy()
        for k in range(1, len(stands)):
            stands[k] += kept * (stands[k - 1] - stands[k])
        return voltage_v + self.read(stands - potential)


class ThermalVoltages(_Potentials):
    """Joints of unlike metals make voltages as they warm: by the room, and by the hand-warm indenter near them."""

    name, source, largest = "thermal_voltages", "Keithley, Low Level Measurements, 2013: thermoelectric voltages", 0.2

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        super().draw(skin, rng)
        frames, center = frames_of(skin), _centers(skin.electrodes)
        per_kelvin, tau_s = rng.standard_normal(len(center)), rng.uniform(20.0, 60.0)
        warm, rows = np.zeros(len(center)), []
        for place, since in zip(frames.contact_m[:, 0], np.diff(frames.time_s, prepend=0.0), strict=True):
            near = np.exp(-((np.hypot(*(center - place).T) / 0.03) ** 2)) if np.isfinite(place).all() else 0.0
            warm = near + (warm - near) * np.exp(-since / tau_s)
            rows.append(warm)
        room = -np.expm1(-frames.time_s / 120.0)
        self.joint = per_kelvin * (np.array(rows) + 0.5 * room[:, None])

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        joint = self.size * self.joint[frame]
        return voltage_v + self.read(np.broadcast_to(joint, self.protocol.current.shape))


class LoosePlug(_Potentials):
    """One electrode's plug is loose: in some scans less of the current gets through it, and what it reads falls
    short."""

    name, source = "loose_plug", "Braunovic et al., Electrical Contacts, 2007, ch. 7: fretting"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        super().draw(skin, rng)
        self.electrode = int(rng.integers(skin.protocol.electrodes))
        self.off = np.cumsum(rng.random(len(frames_of(skin).time_s)) < 0.3) % 2 == 1
        self.details["electrode"] = self.electrode

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        if not self.off[frame]:
            return voltage_v
        short = np.zeros((len(voltage_v), self.protocol.electrodes))
        short[:, self.electrode] = -self.size * self.from_sink()[:, self.electrode]
        driven = (self.protocol.injection == self.electrode).any(axis=1)
        return np.asarray((voltage_v + self.read(short)) * np.where(driven, 1.0 - self.size, 1.0)[:, None])


class DirtyConnector(Unlisted):
    """Flux was left in the connector and draws water from the air: pins side by side leak, more and more."""

    name, source = "dirty_connector", "IPC-TM-650 2.6.3: surface insulation resistance"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        pins = np.eye(skin.protocol.electrodes)
        self.beside = pins[:, :-1] - pins[:, 1:]
        self.siemens = np.square(rng.uniform(0.0, 1.0, self.beside.shape[1])) / skin.sheet_ohm
        self.tau_s = rng.uniform(100.0, 400.0)

    def network(self, transfer_ohm: Array, moment: Moment) -> Array:
        grown = 1.0 - 0.7 * np.exp(-moment.time_s / self.tau_s)
        shunt, between = self.size * grown * self.siemens[:, None], transfer_ohm @ self.beside
        drawn = np.linalg.solve(np.eye(len(shunt)) + shunt * (self.beside.T @ between), shunt * between.T)
        return np.asarray(transfer_ohm - between @ drawn)


class AntistaticPad(_Potentials):
    """The foam conducts a little and the indenter is earthed, as the sink is: pressed, part of the current leaves
    through the pad."""

    name, source, largest = "antistatic_pad", "IEC 61340-5-1: dissipative foams are earthed", 1.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        super().draw(skin, rng)
        self.center_m, self.deep_m = _centers(skin.electrodes), _deepest_m(skin)
        self.siemens = 0.5 / skin.sheet_ohm

    def network(self, transfer_ohm: Array, moment: Moment) -> Array:
        # A place's potential lies between those of the electrodes about it.
        self.near, self.pressed = np.full(len(self.center_m), 1.0 / len(self.center_m)), 0.0
        if len(moment.position_m):
            near = 1.0 / (((self.center_m - moment.position_m[0]) ** 2).sum(axis=1) + 0.01**2)
            self.near, self.pressed = near / near.sum(), float(np.max(moment.depth_m)) / self.deep_m
        return super().network(transfer_ohm, moment)

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        return voltage_v - self.drained(self.near, self.size * self.pressed * self.siemens)


KINDS: tuple[type[Unlisted], ...] = (
    RectifyingContact,
    StrainingStitches,
    SlowCables,
    ThermalVoltages,
    LoosePlug,
    DirtyConnector,
    AntistaticPad,
)
