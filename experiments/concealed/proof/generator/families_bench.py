"""Families in no list, second batch: the stage, its indenter and the load cell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .effect import Moment
from .foam import FoamPart
from .mechanics import _Part
from .simulate import HOLD, frames_of
from .skin import Skin
from .unlisted import Unlisted, _way

Array = NDArray[np.float64]

# ---------------------------------------------------------------------------------------------- stage and indenter


class LateralBacklash(Unlisted):
    """The stage's nuts have play: it stops short on whichever side it comes from."""

    name, source, largest = "lateral_backlash", "ISO 230-2: reversal error of positioning", 0.008

    def moved(self, moments: list[Moment]) -> list[Moment]:
        out, last, side, press = [], np.zeros(2), -np.ones(2), -1
        for m in moments:
            if len(m.position_m) and m.press != press:
                press, way = m.press, m.position_m[0] - last
                side, last = np.where(np.abs(way) > 1e-6, np.sign(way), side), m.position_m[0]
            out.append(replace(m, position_m=m.position_m - 0.5 * self.size * side))
        return out


class HomingJump(Unlisted):
    """Half-way the stage goes home, misses its switch by a step, and everything lies aside from then on."""

    name, source, largest = "homing_jump", "ISO 230-2: repeatability of a reference position", 0.008

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.way, self.first = _way(rng), len(skin.plan.presses) // 2

    def moved(self, moments: list[Moment]) -> list[Moment]:
        step = self.size * self.way
        return [replace(m, position_m=m.position_m + step) if m.press >= self.first else m for m in moments]


class _Swapped(_Part):
    def __init__(self, size: float, first: int) -> None:
        self.size, self.first, self.press = size, first, -1

    def begin(self, position_m: Array, stiffness_n_per_m: float, height_m: float) -> None:
        super().begin(position_m, stiffness_n_per_m, height_m)
        self.press += 1

    def force(self, force_n: float, sunk_m: float, since_s: float) -> float:
        return force_n * (1.0 + 0.7 * self.size) if self.press >= self.first else force_n


class SwappedIndenter(Unlisted):
    """From some press on another indenter is in the holder: wider, and so harder to press in."""

    name, source, largest = "swapped_indenter", "Sneddon, Int. J. Eng. Sci. 3, 1965: force by a punch's radius", 1.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.first = int(np.ceil(rng.uniform(0.3, 0.6) * len(skin.plan.presses)))

    def foam(self) -> FoamPart:
        return _Swapped(self.size, self.first)

    def footprint(self, offset_m: Array, share: Array, force_n: float, moment: Moment) -> tuple[Array, Array]:
        return offset_m * (1.0 + self.size) if moment.press >= self.first else offset_m, share


class EccentricIndenter(Unlisted):
    """The tip sits off its axis and turns on a little from press to press."""

    name, source, largest = "eccentric_indenter", "ISO 230-7: run-out of an axis of rotation", 0.006

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.angle, self.turn = rng.uniform(0, 2 * np.pi), rng.uniform(0.8, 2.4)

    def footprint(self, offset_m: Array, share: Array, force_n: float, moment: Moment) -> tuple[Array, Array]:
        angle = self.angle + self.turn * moment.press
        return offset_m + self.size * np.array([np.cos(angle), np.sin(angle)]), share


class RingingStage(Unlisted):
    """Every step sets the column ringing: scans find it above or below where it should be, except where it is held."""

    name, source, largest = "ringing_stage", "Singer and Seering, J. Dyn. Syst. Meas. Control 112, 1990", 4e-4

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.swing = np.sin(rng.uniform(0, 2 * np.pi, len(frames_of(skin).time_s)))

    def moved(self, moments: list[Moment]) -> list[Moment]:
        out = []
        for m in moments:
            rings = m.frame >= 0 and m.phase != HOLD and len(m.depth_m)
            swing = self.size * self.swing[m.frame] if rings else 0.0
            out.append(replace(m, depth_m=np.maximum(m.depth_m + swing, 0.0)))
        return out


class TiltedPlate(Unlisted):
    """The plate lies askew under the stage: depth counts from too high on one side and from too low on the other."""

    name, source, largest = "tilted_plate", "Slocum, Precision Machine Design, 1992: parallelism of axes", 1.5e-3

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.way, self.middle = _way(rng), skin.box_m.mean(axis=0)
        self.half_m = 0.5 * float(np.max(np.ptp(skin.box_m, axis=0)))

    def moved(self, moments: list[Moment]) -> list[Moment]:
        out = []
        for m in moments:
            higher = self.size * (m.position_m - self.middle) @ self.way / self.half_m
            out.append(replace(m, depth_m=np.where(m.depth_m > 0, np.maximum(m.depth_m + higher, 0.0), 0.0)))
        return out


# ------------------------------------------------------------------------------------------------------- load cell


class LoadCellCreep(Unlisted):
    """The load cell creeps: it says more the longer it bears a load, and doesn't come back to nought at once."""

    name, source, largest = "load_cell_creep", "OIML R 60: creep and return to minimum dead load", 0.4

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.tau_s = rng.uniform(8.0, 40.0)

    def measured_force(self, force_n: Array, moments: list[Moment]) -> Array:
        late, out, time = np.zeros(force_n.shape[1]), np.empty_like(force_n), moments[0].time_s
        for i, m in enumerate(moments):
            late = force_n[i] + (late - force_n[i]) * np.exp(-(m.time_s - time) / self.tau_s)
            time, out[i] = m.time_s, force_n[i] + self.size * late
        return out


class OffAxisLoadCell(Unlisted):
    """The load cell's reading depends on where the load stands: more on one side of the skin, less on the other."""

    name, source, largest = "off_axis_load_cell", "OIML R 76: errors of eccentric loading", 0.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.way, self.middle = _way(rng), skin.box_m.mean(axis=0)
        self.half_m = 0.5 * float(np.max(np.ptp(skin.box_m, axis=0)))

    def measured_force(self, force_n: Array, moments: list[Moment]) -> Array:
        out = force_n.copy()
        for row, m in zip(out, moments, strict=True):
            row[: len(m.position_m)] *= 1.0 + self.size * (m.position_m - self.middle) @ self.way / self.half_m
        return out


class OverloadStop(Unlisted):
    """From some load on the cell's overload stop touches and bears part of what is added."""

    name, source = "overload_stop", "Doebelin, Measurement Systems, 2004, ch. 5: stops of force transducers"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.share = rng.uniform(0.4, 0.65)

    def measured_force(self, force_n: Array, moments: list[Moment]) -> Array:
        return np.asarray(force_n - self.size * np.maximum(force_n - self.share * np.max(force_n), 0.0))


class LateLoadCell(Unlisted):
    """The load cell's filter is slow: of every step a part comes with the frames after it. Size is what half a second
    leaves of it."""

    name, source, largest = "late_load_cell", "Smith, Guide to Digital Signal Processing, 1997, ch. 19", 0.7

    def measured_force(self, force_n: Array, moments: list[Moment]) -> Array:
        out = force_n.copy()
        for i in range(1, len(moments)):
            kept = self.size ** ((moments[i].time_s - moments[i - 1].time_s) / 0.5)
            out[i] = force_n[i] + kept * (out[i - 1] - force_n[i])
        return out


KINDS: tuple[type[Unlisted], ...] = (
    LateralBacklash,
    HomingJump,
    SwappedIndenter,
    EccentricIndenter,
    RingingStage,
    TiltedPlate,
    LoadCellCreep,
    OffAxisLoadCell,
    OverloadStop,
    LateLoadCell,
)
