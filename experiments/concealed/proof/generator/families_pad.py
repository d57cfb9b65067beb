"""Families in no list, second batch: pads that slip, are pieced together, cut, warm or come off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .effect import Moment
from .foam import FoamPart
from .mechanics import _Part
from .skin import Skin
from .unlisted import Unlisted, _deepest_m, _way

Array = NDArray[np.float64]


class SlippingPad(Unlisted):
    """Pressed hard enough the pad slips aside under the indenter, and stays there until it is let go."""

    name, source, largest = "slipping_pad", "Mindlin, J. Appl. Mech. 16, 1949: slip of a loaded contact", 0.008

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.way, self.deep_m = _way(rng), _deepest_m(skin)

    def start(self, points: int) -> None:
        self.press, self.slid = -1, 0.0

    def footprint(self, offset_m: Array, share: Array, force_n: float, moment: Moment) -> tuple[Array, Array]:
        if moment.press != self.press:
            self.press, self.slid = moment.press, 0.0
        over = (float(np.max(moment.depth_m, initial=0.0)) / self.deep_m - 0.45) / 0.25
        self.slid = max(self.slid, min(max(over, 0.0), 1.0))
        return offset_m + self.size * self.slid * self.way, share


class _Pieced(_Part):
    stiffens = True

    def __init__(self, size: float, middle_m: Array, way: Array) -> None:
        self.size, self.middle, self.way = size, middle_m, way

    def begin(self, position_m: Array, stiffness_n_per_m: float, height_m: float) -> None:
        super().begin(position_m, stiffness_n_per_m, height_m)
        self.softer = self.size * 0.5 * (1.0 + float(np.tanh((position_m - self.middle) @ self.way / 0.004)))

    def force(self, force_n: float, sunk_m: float, since_s: float) -> float:
        return force_n * (1.0 - self.softer)


class PiecedPad(Unlisted):
    """The pad is pieced together of two foams: beyond a line across the skin it is softer."""

    name, source, largest = "pieced_pad", "ASTM D3574: slab foams differ in stiffness from piece to piece", 0.6

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        places = np.array([press.position_m[0] for press in skin.plan.presses])
        self.middle, self.way = places.mean(axis=0), _way(rng)

    def foam(self) -> FoamPart:
        return _Pieced(self.size, self.middle, self.way)


class ScoredPad(Unlisted):
    """The pad is scored in strips so that it bends: load spreads along the strips, hardly across them."""

    name, source = "scored_pad", "Huber and Gibson, J. Mater. Sci. 23, 1988: foams stiffer one way"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.way = _way(rng)

    def footprint(self, offset_m: Array, share: Array, force_n: float, moment: Moment) -> tuple[Array, Array]:
        along = np.outer(self.way, self.way)
        across = np.eye(2) - along
        return offset_m @ ((1.0 + 3.0 * self.size) * along + (1.0 - 0.8 * self.size) * across), share


class _Warming(_Part):
    stiffens = True

    def __init__(self, size: float, tau_s: float) -> None:
        self.size, self.tau_s, self.since_s = size, tau_s, 0.0

    def force(self, force_n: float, sunk_m: float, since_s: float) -> float:
        return force_n * (1.0 + self.size * float(np.expm1(-self.since_s / self.tau_s)))

    def settle(self, force_n: float, sunk_m: float, since_s: float) -> None:
        self.since_s += since_s


class WarmingFoam(Unlisted):
    """The whole pad warms up from below and softens, pressed or not."""

    name, source, largest = "warming_foam", "Williams, Landel and Ferry, J. Am. Chem. Soc. 77, 1955", 0.6

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.tau_s = rng.uniform(100.0, 400.0)

    def foam(self) -> FoamPart:
        return _Warming(self.size, self.tau_s)


class LiftedEdge(Unlisted):
    """The pad has come off along one side and curls up: pressed near it, it gives way softly until it lies flat."""

    name, source, largest = "lifted_edge", "Timoshenko, J. Opt. Soc. Am. 11, 1925: layers that curl", 2e-3

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        places = np.array([press.position_m[0] for press in skin.plan.presses])
        self.way = _way(rng)
        self.far = float(np.max(places @ self.way))

    def moved(self, moments: list[Moment]) -> list[Moment]:
        out = []
        for m in moments:
            gap = self.size * np.exp((m.position_m @ self.way - self.far) / 0.02) + 1e-12
            out.append(replace(m, depth_m=np.maximum(m.depth_m + gap * np.expm1(-m.depth_m / gap), 0.0)))
        return out


KINDS: tuple[type[Unlisted], ...] = (
    SlippingPad,
    PiecedPad,
    ScoredPad,
    WarmingFoam,
    LiftedEdge,
)
