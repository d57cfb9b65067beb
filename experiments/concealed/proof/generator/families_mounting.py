"""Families in no list, third batch: how a skin is mounted: rims of its pad, what covers it and what it lies on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .effect import Moment
from .foam import FoamPart
from .mechanics import _Part
from .outline import Outline
from .skin import Skin
from .unlisted import Unlisted, _areas, _deepest_m, _way

Array = NDArray[np.float64]


class SwollenRim(Unlisted):
    """The pad's cut rim has drunk water and swollen: near it the stage touches early."""

    name, source, largest = "swollen_rim", "Treloar, The Physics of Rubber Elasticity, 1975, ch. 7: swelling", 2.5e-3

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.outline, self.reach_m = Outline(skin.outline_m), rng.uniform(0.008, 0.015)

    def moved(self, moments: list[Moment]) -> list[Moment]:
        out = []
        for m in moments:
            swollen = self.size * np.exp(-self.outline.nearest(m.position_m)[2] / self.reach_m)
            out.append(replace(m, depth_m=np.where(m.depth_m > 0, m.depth_m + swollen, 0.0)))
        return out


class _Bulging(_Part):
    stiffens = True

    def __init__(self, size: float, outline: Outline, reach_m: float) -> None:
        self.size, self.outline, self.reach_m = size, outline, reach_m

    def begin(self, position_m: Array, stiffness_n_per_m: float, height_m: float) -> None:
        super().begin(position_m, stiffness_n_per_m, height_m)
        self.softer = self.size * float(np.exp(-self.outline.nearest(position_m[None])[2][0] / self.reach_m))

    def force(self, force_n: float, sunk_m: float, since_s: float) -> float:
        return force_n * (1.0 - self.softer)


class FreeRim(Unlisted):
    """The pad ends with the sheet: pressed near its rim it bulges out sideways and bears less."""

    name, source, largest = "free_rim", "Gent and Lindley, Proc. Inst. Mech. Eng. 173, 1959: blocks that bulge", 0.8

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.outline, self.reach_m = Outline(skin.outline_m), rng.uniform(0.01, 0.015)

    def foam(self) -> FoamPart:
        return _Bulging(self.size, self.outline, self.reach_m)


class WalkingSkin(Unlisted):
    """The skin lies loose on its plate: every press drives it on a little the same way, and it doesn't come back."""

    name, source, largest = "walking_skin", "Mindlin and Deresiewicz, J. Appl. Mech. 20, 1953: slip that adds up", 0.01

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.way, work = _way(rng), [float(np.max(press.depth_m)) for press in skin.plan.presses]
        self.gone = np.cumsum([0.0, *work]) / np.sum(work)

    def moved(self, moments: list[Moment]) -> list[Moment]:
        step = self.size * self.way
        return [replace(m, position_m=m.position_m - step * self.gone[m.press]) for m in moments]


class TautCover(Unlisted):
    """A cover is drawn taut over the skin: it stands like a tent about the indenter and spreads part of the load."""

    name, source = "taut_cover", "Landau and Lifshitz, Theory of Elasticity, 1986, section 14: a membrane's tent"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.reach_m = rng.uniform(0.006, 0.01)

    def sensitivity(self, point_m: Array) -> Array | None:
        self.area_m2 = _areas(point_m)
        return None

    def pressure(self, point_m: Array, pressure_pa: Array, moment: Moment) -> Array:
        spread = np.zeros(len(point_m))
        for place in moment.position_m:
            tent = np.exp(-np.hypot(*(point_m - place).T) / self.reach_m)
            spread += tent / (tent @ self.area_m2) / len(moment.position_m)
        return np.asarray(pressure_pa + self.size * (pressure_pa @ self.area_m2 * spread - pressure_pa))


class SealedCover(Unlisted):
    """The skin lies in an airtight cover: pressed anywhere, the air shut in presses everywhere."""

    name, source = "sealed_cover", "Boyle's law, 1662: air shut in a bag"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.deep_m, self.scale_pa = _deepest_m(skin), 0.1 * skin.law.top_pa

    def pressure(self, point_m: Array, pressure_pa: Array, moment: Moment) -> Array:
        squeezed = 0.5 * self.size * float(np.sum(moment.depth_m)) / self.deep_m
        return np.asarray(pressure_pa + self.scale_pa * squeezed / (1.0 - 0.5 * min(squeezed, 1.0)))


class BowedPlate(Unlisted):
    """The plate lies on two battens and bows under the press: cloth glued to it is strained all over, most in line
    with the press."""

    name, source, largest = "bowed_plate", "Gere and Timoshenko, Mechanics of Materials, 1997, ch. 4: beams", 1.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.along, self.deep_m = _way(rng), _deepest_m(skin)
        corner = skin.outline_m @ self.along
        self.low_m, self.span_m = float(corner.min()), float(np.ptp(corner))

    def sheet(self, point_m: Array, moment: Moment) -> Array | None:
        if not len(moment.position_m):
            return None
        at, total = (point_m @ self.along - self.low_m) / self.span_m, np.zeros(len(point_m))
        for place, depth in zip(moment.position_m, moment.depth_m, strict=True):
            load = np.clip((place @ self.along - self.low_m) / self.span_m, 0.05, 0.95)
            # Bending moment of a force at a share of the span, over that of one in the middle.
            total += 4.0 * depth / self.deep_m * np.minimum(at * (1.0 - load), load * (1.0 - at))
        return np.asarray(-self.size * total)


KINDS: tuple[type[Unlisted], ...] = (
    SwollenRim,
    FreeRim,
    WalkingSkin,
    TautCover,
    SealedCover,
    BowedPlate,
)
