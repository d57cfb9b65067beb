"""Physics in no list: what a diagnosis has no name for and should say so. The first batch, and the index of all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from . import (
    families_bench,
    families_contacts,
    families_instrument,
    families_mounting,
    families_pad,
    families_sheet,
    families_signals,
    families_stage,
    families_timing,
    families_wear,
)
from .effect import Moment
from .electrodes import _centers
from .skin import Skin
from .unlisted import Unlisted, _along, _inside

Array = NDArray[np.float64]


# --------------------------------------------------------------------------------------------------------- the sheet


class Cut(Unlisted):
    """A slit in the sheet that opens where it is pressed and closes in between."""

    name, source, largest = "opening_cut", "crack mouths open under load: Anderson, Fracture Mechanics, 2005", 12.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.start_m = _inside(skin, rng)
        angle = rng.uniform(0, np.pi)
        self.stop_m = self.start_m + 0.03 * np.array([np.cos(angle), np.sin(angle)])
        self.scale_pa = 0.05 * skin.law.top_pa
        self.near: Array | None = None

    def gain(self, log_gain: Array, pressure_pa: Array, since_s: float) -> Array:
        if self.near is None or len(self.near) != len(log_gain):
            return log_gain
        return np.asarray(log_gain - self.size * self.near * np.minimum(pressure_pa / self.scale_pa, 3.0))

    def sensitivity(self, point_m: Array) -> Array | None:
        distance, _ = _along(point_m, self.start_m, self.stop_m)
        self.near = np.exp(-((distance / 1.5e-3) ** 2))
        return None


class StretchedSheet(Unlisted):
    """The cloth is drawn into the dent: strain raises its resistance in a ring about the press."""

    name, source, largest = "stretched_sheet", "strain gauges of knitted cloth: Atalay et al., Sensors 13, 2013", 1.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.deep_m = max(float(np.max(p.depth_m)) for p in skin.plan.presses)

    def sheet(self, point_m: Array, moment: Moment) -> Array:
        total = np.zeros(len(point_m))
        for place, depth in zip(moment.position_m, moment.depth_m, strict=True):
            radius = np.hypot(*(point_m - place).T)
            total -= (depth / self.deep_m) ** 2 * np.exp(-(((radius - 0.009) / 0.004) ** 2))
        return self.size * total


class PressedWeave(Unlisted):
    """Pressing flattens the weft: where pressed, the sheet conducts better one way only."""

    name, source, largest = "pressed_weave", "Peirce's crimp geometry, 1937; fibre contacts align under load", 1.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        angle = rng.uniform(0, np.pi)
        way = np.array([np.cos(angle), np.sin(angle)])
        self.tensor, self.scale_pa = np.outer(way, way) - 0.5 * np.eye(2), 0.4 * skin.law.top_pa

    def direction(self, point_m: Array, pressure_pa: Array) -> Array:
        share = np.tanh(np.maximum(pressure_pa, 0) / self.scale_pa) * self.size
        # exp of a symmetric traceless 2x2 matrix whose square is 1/4.
        return np.cosh(0.5 * share)[:, None, None] * np.eye(2) + 2 * np.sinh(0.5 * share)[:, None, None] * self.tensor


class RigidPatches(Unlisted):
    """Stiff patches share their pressure out: each conducts by its mean."""

    name, source = "rigid_patches", "paper II-A: a grid of discrete low-resistance patches"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.low, self.pitch = skin.box_m[0] + rng.uniform(-0.004, 0.0, 2), 0.007

    def pressure(self, point_m: Array, pressure_pa: Array, moment: Moment) -> Array:
        cell = np.floor((point_m - self.low) / self.pitch).astype(int) + 2
        number = cell[:, 0] * 1000 + cell[:, 1]
        _, number = np.unique(number, return_inverse=True)
        mean = np.bincount(number, pressure_pa) / np.bincount(number)
        return np.asarray((1 - self.size) * pressure_pa + self.size * mean[number])


class SnappingPocket(Unlisted):
    """A pocket of the sheet stays open until pressed hard, then snaps shut until nearly let go."""

    name, source, largest = "snapping_pocket", "snap-through of shallow shells: Timoshenko and Gere, 1961", 2.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.center, self.shut_pa = _inside(skin, rng, 0.05, 0.95), 0.12 * skin.law.top_pa
        self.open_pa = 0.3 * self.shut_pa

    def start(self, points: int) -> None:
        self.shut = np.zeros(points, dtype=bool)

    def sensitivity(self, point_m: Array) -> Array | None:
        radius = np.hypot(*(point_m - self.center).T)
        self.weight = 1.0 / (1.0 + (radius / 0.022) ** 6)
        return None

    def gain(self, log_gain: Array, pressure_pa: Array, since_s: float) -> Array:
        if len(log_gain) != len(getattr(self, "weight", ())):
            return log_gain
        self.shut = (self.shut & (pressure_pa > self.open_pa)) | (pressure_pa > self.shut_pa)
        return np.asarray(log_gain + self.size * self.weight * np.where(self.shut, 0.35, -0.6 * log_gain))


class TrappedAir(Unlisted):
    """Air under the pad carries part of the load evenly at first and leaks away."""

    name, source = "trapped_air", "squeeze films: Hamrock, Fluid Film Lubrication, 1994, ch. 5"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.leak_s = rng.uniform(3.0, 8.0)

    def start(self, points: int) -> None:
        self.pressed_s = 0.0

    def pressure(self, point_m: Array, pressure_pa: Array, moment: Moment) -> Array:
        self.pressed_s = self.pressed_s + moment.since_s if len(moment.position_m) else 0.0
        if not len(moment.position_m) or not pressure_pa.any():
            return pressure_pa
        carried = self.size * np.exp(-self.pressed_s / self.leak_s)
        radius = np.hypot(*(point_m - moment.position_m[0]).T)
        disk = 1.0 / (1.0 + (radius / 0.018) ** 8)
        even = disk * (pressure_pa @ disk) / (disk @ disk)
        return np.asarray((1 - carried) * pressure_pa + carried * even)


class Tear(Unlisted):
    """Half-way through the recording the sheet tears a little."""

    name, source, largest = "tear_event", "a crack that runs on: Anderson, Fracture Mechanics, 2005", 5.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.start_m, self.after_s = _inside(skin, rng), 0.45 * skin.plan.duration_s
        angle = rng.uniform(0, np.pi)
        self.stop_m = self.start_m + 0.02 * np.array([np.cos(angle), np.sin(angle)])

    def sheet(self, point_m: Array, moment: Moment) -> Array:
        if moment.time_s < self.after_s:
            return np.zeros(len(point_m))
        distance, _ = _along(point_m, self.start_m, self.stop_m)
        return np.asarray(-self.size * np.exp(-((distance / 1.5e-3) ** 2)))


class DeadZone(Unlisted):
    """The pair doesn't touch below a threshold: a kink no fifth-order polynomial has."""

    name, source = "dead_zone", "spacer fabrics: contact begins at a finite gap"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.threshold_pa = 0.25 * skin.law.top_pa

    def felt(self, pressure_pa: Array, since_s: float) -> Array:
        over = np.maximum(pressure_pa - self.threshold_pa, 0.0) * 1.2
        return np.asarray((1 - self.size) * pressure_pa + self.size * over)


class ForgottenWeight(Unlisted):
    """From some press on something lies on the skin that no record mentions."""

    name, source, largest = "forgotten_weight", "a cable or tool left on the bench", 6.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.center, self.after_s = _inside(skin, rng, 0.1, 0.9), 0.3 * skin.plan.duration_s
        self.scale_pa = 0.1 * skin.law.top_pa

    def pressure(self, point_m: Array, pressure_pa: Array, moment: Moment) -> Array:
        if moment.time_s < self.after_s:
            return pressure_pa
        radius = np.hypot(*(point_m - self.center).T)
        return np.asarray(pressure_pa + self.size * self.scale_pa / (1.0 + (radius / 0.012) ** 4))


# ------------------------------------------------------------------------------------------------- pad and indenter


class TiltedIndenter(Unlisted):
    """The indenter stands askew: one edge presses harder."""

    name, source = "tilted_indenter", "tilted flat punch: Johnson, Contact Mechanics, 1985"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.angle, self.radius = rng.uniform(0, 2 * np.pi), 0.5 * skin.diameter_m

    def footprint(self, offset_m: Array, share: Array, force_n: float, moment: Moment) -> tuple[Array, Array]:
        way = np.array([np.cos(self.angle), np.sin(self.angle)])
        lean = share * (1.0 + 1.6 * self.size * offset_m @ way / (0.5 * self.radius))
        return offset_m, np.maximum(lean, 0) / np.maximum(lean, 0).sum()


class FlatPunch(Unlisted):
    """A rigid flat face presses along its rim rather than at four points."""

    name, source = "flat_punch", "Boussinesq's punch: Johnson, Contact Mechanics, 1985"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.radius = 0.5 * skin.diameter_m

    def footprint(self, offset_m: Array, share: Array, force_n: float, moment: Moment) -> tuple[Array, Array]:
        angle = 2 * np.pi * (np.arange(12) + 0.5) / 12
        ring = 1.15 * self.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return np.concatenate([offset_m, ring]), np.concatenate([(1 - self.size) * share, np.full(12, self.size / 12)])


class RoundTip(Unlisted):
    """A round tip touches at a point and spreads out with the cube root of the force."""

    name, source, largest = "round_tip", "Hertz, J. reine angew. Math. 92, 1882", 1.0

    def footprint(self, offset_m: Array, share: Array, force_n: float, moment: Moment) -> tuple[Array, Array]:
        wide = (1.0 - self.size) + 0.35 * self.size * np.cbrt(max(force_n, 1e-6))
        return offset_m * wide, share


class DraggedPad(Unlisted):
    """The stage leans as it presses: the place moves sideways with depth."""

    name, source, largest = "dragged_pad", "Abbe error of a leaning column: Slocum 1992", 0.006

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        angle = rng.uniform(0, 2 * np.pi)
        self.way = np.array([np.cos(angle), np.sin(angle)])
        self.deep_m = max(float(np.max(p.depth_m)) for p in skin.plan.presses)

    def footprint(self, offset_m: Array, share: Array, force_n: float, moment: Moment) -> tuple[Array, Array]:
        lean = float(np.max(moment.depth_m, initial=0.0)) / self.deep_m
        return offset_m + self.size * lean**2 * self.way, share


class SoftBase(Unlisted):
    """The rigid plate is none: it gives way in its middle, so places differ in force."""

    name, source, largest = "soft_base", "clamped plate: Timoshenko and Woinowsky-Krieger, 1959", 0.6

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.box = skin.box_m

    def moved(self, moments: list[Moment]) -> list[Moment]:
        low, high = self.box
        out = []
        for m in moments:
            share = (m.position_m - low) / (high - low)
            give = self.size * np.prod(np.sin(np.pi * np.clip(share, 0, 1)) ** 2, axis=1)
            out.append(replace(m, depth_m=m.depth_m * (1.0 - give)))
        return out


class LostSteps(Unlisted):
    """The stage's motor loses steps: every press goes a little less deep than the one before."""

    name, source, largest = "lost_steps", "stepper motors: Acarnley, 2002", 0.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.lost_s = np.sort(rng.uniform(0.1, 0.9, 6)) * skin.plan.duration_s

    def moved(self, moments: list[Moment]) -> list[Moment]:
        share = np.searchsorted(self.lost_s, [m.time_s for m in moments]) / len(self.lost_s)
        return [replace(m, depth_m=m.depth_m * (1.0 - self.size * s)) for m, s in zip(moments, share, strict=True)]


class LoadCellDrift(Unlisted):
    """The load cell's zero wanders with its temperature."""

    name, source, largest = "load_cell_drift", "OIML R 60: zero drift of load cells", 3.0

    def measured_force(self, force_n: Array, moments: list[Moment]) -> Array:
        time = np.array([m.time_s for m in moments])
        return np.asarray(force_n + self.size * (np.sin(time / 140.0) + 0.5 * time / time[-1])[:, None])


# ------------------------------------------------------------------------------------------------ wires, instrument


class StrayThread(Unlisted):
    """A conducting thread lies across two electrodes."""

    name, source = "stray_thread", "a shunt between two nodes of a network: Kirchhoff"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        near = np.argsort(np.hypot(*(_centers(skin.electrodes) - _centers(skin.electrodes)[0]).T))
        first = int(rng.integers(len(near)))
        self.pair = (first, int(near[-1]) if first != int(near[-1]) else int(near[0]))
        self.siemens = 1.0 / skin.sheet_ohm
        self.details["electrodes"] = list(self.pair)

    def network(self, transfer_ohm: Array, moment: Moment) -> Array:
        # It comes and goes with the load: the thread is pressed on with the pad.
        if not len(moment.depth_m) or self.size == 0.0:
            return transfer_ohm
        way = np.zeros(len(transfer_ohm))
        way[self.pair[0]], way[self.pair[1]] = 1.0, -1.0
        shunt = self.size * self.siemens * float(np.max(moment.depth_m)) / 4e-3
        column = transfer_ohm @ way
        return transfer_ohm - shunt * np.outer(column, column) / (1.0 + shunt * way @ column)


class Leakage(Unlisted):
    """The inputs leak into a wet base, the more the higher they stand: readings come short by a share of themselves."""

    name, source, largest = "leakage_to_base", "guarding of high-resistance circuits: Keithley, 2013", 1.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.injection, self.current = skin.protocol.injection, float(np.max(skin.protocol.current))
        self.ohm, self.weights = skin.sheet_ohm, skin.protocol.weights

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        scale = self.current * self.ohm
        return np.asarray(voltage_v * (1.0 - self.size * np.abs(voltage_v) / scale / (1.0 + np.abs(voltage_v) / scale)))


class SwappedChannels(Unlisted):
    """From some press on two channels' plugs are in each other's sockets."""

    name, source = "swapped_channels", "a mistake at the bench"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        columns = len(skin.protocol.read) if skin.protocol.read is not None else skin.protocol.electrodes
        first = int(rng.integers(columns))
        self.pair, self.late = (first, (first + 1) % columns), 0.5

    def recorded(self, voltage_v: Array, moving: NDArray[np.bool_], rng: np.random.Generator) -> Array:
        out = voltage_v.copy()
        a, b = self.pair
        after = int(self.late * len(voltage_v))
        mixed = self.size * (voltage_v[after:, :, b] - voltage_v[after:, :, a])
        out[after:, :, a] += mixed
        out[after:, :, b] -= mixed
        return out


class CurrentDroop(Unlisted):
    """The current source has a finite output impedance: less goes in where more voltage is needed."""

    name, source, largest = "current_droop", "Howland pumps: Franco, 2015, section 2.2", 0.6

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.injection, self.ohm = skin.protocol.injection, skin.sheet_ohm
        self.resistance: Array | None = None

    def network(self, transfer_ohm: Array, moment: Moment) -> Array:
        i, j = self.injection.T
        self.resistance = transfer_ohm[i, i] + transfer_ohm[j, j] - 2 * transfer_ohm[i, j]
        return transfer_ohm

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        assert self.resistance is not None
        return np.asarray(voltage_v / (1.0 + self.size * self.resistance / self.ohm)[:, None])


class CommonMode(Unlisted):
    """The amplifier answers a little to the mean of its inputs."""

    name, source, largest = "common_mode", "finite rejection: Pallàs-Areny and Webster, 1991", 0.5

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        return np.asarray(voltage_v + self.size * np.nanmean(voltage_v, axis=1, keepdims=True))


class LateFrames(Unlisted):
    """The reader hands out part of the scan from the frame before."""

    name, source = "late_frames", "a double buffer swapped too late"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.first = int(rng.integers(len(skin.protocol.injection) // 2))
        self.count = max(1, len(skin.protocol.injection) // 8)

    def recorded(self, voltage_v: Array, moving: NDArray[np.bool_], rng: np.random.Generator) -> Array:
        out = voltage_v.copy()
        rows = slice(self.first, self.first + self.count)
        out[1:, rows] += self.size * (voltage_v[:-1, rows] - voltage_v[1:, rows])
        return out


class PopcornChannel(Unlisted):
    """One channel's offset jumps between two levels."""

    name, source, largest = (
        "popcorn_channel",
        "burst noise: Hsu, Whittier and Mead, Solid-State Electron. 13, 1970",
        1.0,
    )

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        columns = len(skin.protocol.read) if skin.protocol.read is not None else skin.protocol.electrodes
        self.channel = int(rng.integers(columns))
        self.details["channel"] = self.channel

    def recorded(self, voltage_v: Array, moving: NDArray[np.bool_], rng: np.random.Generator) -> Array:
        out = voltage_v.copy()
        high = np.cumsum(rng.random(voltage_v.shape[:2]).ravel() < 0.004).reshape(voltage_v.shape[:2]) % 2
        out[:, :, self.channel] += self.size * high
        return out


class UnsettledInjection(Unlisted):
    """A scan begins before the current has settled: the first readings of every injection come short."""

    name, source, largest = "unsettled_injection", "charging of the sheet's capacitance: RC transient", 0.9

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        short = self.size * np.exp(-np.arange(voltage_v.shape[1]) / 2.5)
        return np.asarray(voltage_v * (1.0 - short))


class Microphonics(Unlisted):
    """Wires shake while the stage moves: readings scatter more then, all channels together."""

    name, source, largest = "microphonics", "triboelectric cable noise: Keithley, Low Level Measurements, 2013", 1.0

    def recorded(self, voltage_v: Array, moving: NDArray[np.bool_], rng: np.random.Generator) -> Array:
        shake = rng.standard_normal(voltage_v.shape[:2]) * moving[:, None]
        return np.asarray(voltage_v + self.size * shake[..., None])


class RangeSwitch(Unlisted):
    """Above a threshold the amplifier takes its other range, whose gain is another."""

    name, source, largest = "range_switch", "auto-ranging: Horowitz and Hill, ch. 13", 0.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.threshold_v = float(np.max(skin.protocol.current) * skin.sheet_ohm * rng.uniform(0.5, 0.8))

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        return np.asarray(np.where(np.abs(voltage_v) > self.threshold_v, voltage_v * (1.0 + self.size), voltage_v))


FIRST: dict[str, type[Unlisted]] = {k.name: k for k in Unlisted.__subclasses__() if k.__module__ == __name__}
SECOND: dict[str, type[Unlisted]] = {
    kind.name: kind
    for part in (families_sheet, families_pad, families_bench, families_instrument)
    for kind in part.KINDS
}
THIRD: dict[str, type[Unlisted]] = {
    kind.name: kind
    for part in (
        families_stage, families_mounting, families_wear, families_contacts, families_timing, families_signals,
    )
    for kind in part.KINDS
}  # fmt: skip
FAMILIES = FIRST | SECOND | THIRD
