"""Families in no list, third batch: screws, columns and guides of the stage, and what its force indicator does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .effect import Moment
from .foam import FoamPart
from .mechanics import _Part
from .skin import Skin
from .unlisted import Unlisted, _deepest_m

Array = NDArray[np.float64]


class DrunkenScrew(Unlisted):
    """The screw's thread runs drunken: once a turn the stage is ahead of where it should be, and once behind."""

    name, source, largest = "drunken_screw", "Slocum, Precision Machine Design, 1992: periodic errors of lead", 8e-4

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.lead_m, self.phase = rng.uniform(0.8e-3, 1.6e-3), rng.uniform(0, 2 * np.pi)

    def moved(self, moments: list[Moment]) -> list[Moment]:
        out = []
        for m in moments:
            turned = np.sin(2 * np.pi * m.depth_m / self.lead_m + self.phase) - np.sin(self.phase)
            out.append(replace(m, depth_m=np.maximum(m.depth_m + self.size * turned, 0.0)))
        return out


class WarmingColumn(Unlisted):
    """The stage's column warms up and grows: the later a press, the deeper it goes."""

    name, source, largest = "warming_column", "ISO 230-3: thermal distortion of machine tools", 1.5e-3

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.tau_s = rng.uniform(100.0, 400.0)

    def moved(self, moments: list[Moment]) -> list[Moment]:
        out = []
        for m in moments:
            grown = -self.size * np.expm1(-m.time_s / self.tau_s)
            out.append(replace(m, depth_m=np.where(m.depth_m > 0, m.depth_m + grown, 0.0)))
        return out


class StalledStage(Unlisted):
    """The motor is too weak for the deepest steps: it stands still there and goes on once the way leads back."""

    name, source = "stalled_stage", "Acarnley, Stepping Motors, 2002: pull-out torque"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.deep_m = _deepest_m(skin)

    def moved(self, moments: list[Moment]) -> list[Moment]:
        most_m = self.deep_m * (1.0 - 0.75 * self.size)
        return [replace(m, depth_m=np.minimum(m.depth_m, most_m)) for m in moments]


class _Shoulder(_Part):
    def __init__(self, size: float, gap_m: float) -> None:
        self.size, self.gap_m = size, gap_m

    def force(self, force_n: float, sunk_m: float, since_s: float) -> float:
        return force_n + self.size * self.stiffness * max(sunk_m - self.gap_m, 0.0)


class ShoulderContact(Unlisted):
    """Deep enough, the shoulder of the indenter's holder touches the pad and bears on a ring about the tip."""

    name, source, largest = "shoulder_contact", "Barber, Contact Mechanics, 2018: contact areas that grow by parts", 2.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.gap_m, self.radius_m = rng.uniform(0.4, 0.6) * _deepest_m(skin), rng.uniform(0.9, 1.2) * skin.diameter_m

    def foam(self) -> FoamPart:
        return _Shoulder(self.size, self.gap_m)

    def footprint(self, offset_m: Array, share: Array, force_n: float, moment: Moment) -> tuple[Array, Array]:
        depth = float(np.max(moment.depth_m, initial=0.0))
        borne = self.size * max(depth - self.gap_m, 0.0)
        if borne == 0.0:
            return offset_m, share
        part, angle = borne / (depth + borne), 2 * np.pi * np.arange(12) / 12
        ring = self.radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return np.concatenate([offset_m, ring]), np.concatenate([(1 - part) * share, np.full(12, part / 12)])


# ------------------------------------------------------------------------------------------------------- load cell


class GuideFriction(Unlisted):
    """The load cell sits above the plunger's guide and bears its friction too: more on the way in, less on the way
    out, and held it keeps what the last step left. Size in newton."""

    name, source, largest = "guide_friction", "Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30, 1994", 2.0

    def measured_force(self, force_n: Array, moments: list[Moment]) -> Array:
        out, before, side = force_n.copy(), np.zeros(0), 0.0
        for row, m in zip(out, moments, strict=True):
            way = float(np.sum(m.depth_m) - np.sum(before)) if len(m.depth_m) else 0.0
            side = (float(np.sign(way)) or side) if len(m.depth_m) else 0.0
            row[: len(m.depth_m)] += self.size * side
            before = m.depth_m
        return out


class ZeroTracking(Unlisted):
    """The indicator takes light loads for a zero that has wandered and follows them. Size is the share that it follows
    in half a second."""

    name, source, largest = "zero_tracking", "OIML R 76: zero-tracking devices", 0.9

    def measured_force(self, force_n: Array, moments: list[Moment]) -> Array:
        out, zero, time = np.empty_like(force_n), np.zeros(force_n.shape[1]), moments[0].time_s
        band = 1.6 * float(np.min(force_n[force_n > 0], initial=np.max(force_n)))
        for i, m in enumerate(moments):
            followed = 1.0 - (1.0 - self.size) ** ((m.time_s - time) / 0.5)
            light = np.abs(force_n[i] - zero) < band
            zero = zero + np.where(light, followed * (force_n[i] - zero), 0.0)
            time, out[i] = m.time_s, force_n[i] - zero
        return out


KINDS: tuple[type[Unlisted], ...] = (
    DrunkenScrew,
    WarmingColumn,
    StalledStage,
    ShoulderContact,
    GuideFriction,
    ZeroTracking,
)
