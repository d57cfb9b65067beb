"""Families in no list, third batch: marks that presses leave on the cloth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .effect import Moment
from .outline import Outline
from .skin import Skin
from .unlisted import Unlisted, _deepest_m

Array = NDArray[np.float64]


class DrawnThreads(Unlisted):
    """Every press draws threads in towards it and they stay: about the place current goes in and out more easily than
    round it."""

    name, source, largest = "drawn_threads", "Kawabata, Niwa and Kawai, J. Text. Inst. 64, 1973: drawn weave", 1.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.deep_m, self.radius_m = _deepest_m(skin), rng.uniform(0.006, 0.01)

    def start(self, points: int) -> None:
        self.drawn, self.press, self.most = np.zeros((points, 2, 2)), -1, 0.0

    def pressure(self, point_m: Array, pressure_pa: Array, moment: Moment) -> Array:
        if moment.press != self.press:
            self.press, self.most = moment.press, 0.0
        load = (float(np.max(moment.depth_m, initial=0.0)) / self.deep_m) ** 2
        if load > self.most:
            for place in moment.position_m:
                self.drawn = self.drawn + (load - self.most) * self._towards(point_m, place)
            self.most = load
        return pressure_pa

    def _towards(self, point_m: Array, place_m: Array) -> Array:
        """(n,2,2) symmetric and traceless, along the way to the place."""
        radius = np.hypot(*(point_m - place_m).T) + 1e-9
        way = (point_m - place_m) / radius[:, None]
        ring = np.exp(-(((radius - self.radius_m) / (0.5 * self.radius_m)) ** 2))
        return np.asarray(ring[:, None, None] * (2.0 * way[:, :, None] * way[:, None, :] - np.eye(2)))

    def direction(self, point_m: Array, pressure_pa: Array) -> Array:
        drawn = self.size * self.drawn
        # exp of a symmetric traceless 2x2 matrix, whose square is a multiple of one.
        root = np.hypot(drawn[:, 0, 0], drawn[:, 0, 1])[:, None, None] + 1e-12
        return np.asarray(np.cosh(root) * np.eye(2) + np.sinh(root) / root * drawn)


class SqueezedCoating(Unlisted):
    """The coating is soft and flows from under the press as long as it is held: thinner there for good, thicker
    about it."""

    name, source, largest = "squeezed_coating", "Stefan, Sitzungsber. Akad. Wiss. Wien 69, 1874: squeezed films", 2.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.deep_m, self.radius_m, self.tau_s = _deepest_m(skin), rng.uniform(0.005, 0.008), rng.uniform(15.0, 40.0)

    def start(self, points: int) -> None:
        self.gone = np.zeros(points)

    def sheet(self, point_m: Array, moment: Moment) -> Array:
        for place, depth in zip(moment.position_m, moment.depth_m, strict=True):
            share = ((point_m - place) ** 2).sum(axis=1) / self.radius_m**2
            # What goes from the middle comes to lie about it.
            left = (1.0 - share) * np.exp(-share)
            self.gone = self.gone + moment.since_s / self.tau_s * depth / self.deep_m * left
        return np.asarray(-self.size * np.tanh(self.gone))


class FrayedRim(Unlisted):
    """The sheet's cut edge frays as it is worked, here more, there less: a ragged strip conducts ever worse."""

    name, source, largest = "frayed_rim", "ASTM D434: yarns slip out of a cut edge", 4.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.outline, self.count = Outline(skin.outline_m), len(skin.plan.presses)
        self.waves, self.phase = int(rng.integers(2, 6)), rng.uniform(0, 2 * np.pi)

    def sensitivity(self, point_m: Array) -> Array | None:
        turn = 2 * np.pi * self.outline.way(point_m) / self.outline.length_m
        ragged = 0.5 * (1.0 + np.sin(self.waves * turn + self.phase))
        self.strip = ragged * np.exp(-self.outline.nearest(point_m)[2] / 0.006)
        return None

    def sheet(self, point_m: Array, moment: Moment) -> Array:
        return np.asarray(-self.size * moment.press / self.count * self.strip)


KINDS: tuple[type[Unlisted], ...] = (
    DrawnThreads,
    SqueezedCoating,
    FrayedRim,
)
