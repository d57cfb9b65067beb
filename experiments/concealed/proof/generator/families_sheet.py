"""Families in no list, second batch: water, folds, wear and strain of the cloth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .effect import Moment
from .skin import Skin
from .unlisted import Unlisted, _areas, _deepest_m, _pressed, _way

Array = NDArray[np.float64]


class WetPatch(Unlisted):
    """A drop falls on the cloth and wicks outwards, as far as the root of time: where wet it conducts better."""

    name, source, largest = "wet_patch", "Washburn, Phys. Rev. 17, 1921: liquid drawn into pores", 1.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.center, self.after_s = _pressed(skin, rng, 0.01), rng.uniform(0.1, 0.3) * skin.plan.duration_s
        self.m2_per_s = rng.uniform(1e-6, 3e-6)

    def sheet(self, point_m: Array, moment: Moment) -> Array | None:
        if moment.time_s <= self.after_s:
            return None
        front = np.sqrt(self.m2_per_s * (moment.time_s - self.after_s))
        radius = np.hypot(*(point_m - self.center).T)
        return np.asarray(self.size * 0.5 * (1.0 - np.tanh((radius - front) / 0.003)))


class CreasedSheet(Unlisted):
    """The sheet was kept folded: where a crease is pressed flat its plies touch and current steps across it."""

    name, source, largest = "creased_sheet", "Benusiglio et al., Soft Matter 8, 2012: the anatomy of a crease", 3.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.middle, self.across, self.pitch_m = _pressed(skin, rng, 0.003), _way(rng), 0.03
        self.scale_pa = 0.05 * skin.law.top_pa

    def direction(self, point_m: Array, pressure_pa: Array) -> Array:
        at = (point_m - self.middle) @ self.across / self.pitch_m
        distance = self.pitch_m * np.abs(at - np.round(at))
        shut = np.exp(-((distance / 4e-3) ** 2)) * np.tanh(np.maximum(pressure_pa, 0.0) / self.scale_pa)
        better = np.expm1(self.size * shut)
        return np.eye(2) + better[:, None, None] * np.outer(self.across, self.across)


class BreakingThreads(Unlisted):
    """Every press breaks some threads across the place: the sheet loses conductance there for good, press by press."""

    name, source, largest = "breaking_threads", "Daniels, Proc. R. Soc. A 183, 1945: bundles of threads", 2.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.along, self.deep_m = _way(rng), _deepest_m(skin)
        self.across = np.array([-self.along[1], self.along[0]])

    def start(self, points: int) -> None:
        self.broken, self.press, self.most = np.zeros(points), -1, 0.0

    def sheet(self, point_m: Array, moment: Moment) -> Array:
        if moment.press != self.press:
            self.press, self.most = moment.press, 0.0
        load = (float(np.max(moment.depth_m, initial=0.0)) / self.deep_m) ** 2
        if load > self.most:
            for place in moment.position_m:
                ahead, aside = (point_m - place) @ self.along, (point_m - place) @ self.across
                near = np.exp(-((ahead / 0.014) ** 4) - (aside / 0.002) ** 2)
                self.broken = self.broken + (load - self.most) * near
            self.most = load
        return np.asarray(-self.size * self.broken)


class WornCoating(Unlisted):
    """Loading rubs the coating off: a place gains less under pressure and conducts worse at rest, the more it bore."""

    name, source = "worn_coating", "Archard, J. Appl. Phys. 24, 1953: wear goes with load and way"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.scale_pa = 3.0 * skin.law.top_pa

    def start(self, points: int) -> None:
        self.borne_pa, self.last_pa = np.zeros(points), np.zeros(points)

    def _lost(self) -> Array:
        return np.asarray(-self.size * np.expm1(-self.borne_pa / self.scale_pa))

    def gain(self, log_gain: Array, pressure_pa: Array, since_s: float) -> Array:
        self.borne_pa = self.borne_pa + np.maximum(pressure_pa - self.last_pa, 0.0)
        self.last_pa = pressure_pa
        return np.asarray(log_gain * (1.0 - self._lost()))

    def sheet(self, point_m: Array, moment: Moment) -> Array:
        return -0.4 * self._lost()


class GritUnderSheet(Unlisted):
    """Grains lie under the sheet and bear what is pressed about them: a neighbourhood's load stands on a spot."""

    name, source = "grit_under_sheet", "Eshelby, Proc. R. Soc. A 241, 1957: stiff inclusions draw stress"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        low, high = skin.box_m
        pitch_m = 0.015
        count = np.maximum(np.round((high - low) / pitch_m).astype(int), 1)
        at = np.stack(np.meshgrid(*(np.arange(n) for n in count), indexing="ij"), axis=-1).reshape(-1, 2)
        self.grain_m = low + pitch_m * (at + rng.uniform(0.1, 0.9, at.shape))

    def sensitivity(self, point_m: Array) -> Array | None:
        distance, self.owner = cKDTree(self.grain_m).query(point_m)
        self.area, spot = _areas(point_m), np.exp(-((distance / 0.0025) ** 2))
        self.spot = spot / np.maximum(self._sums(spot * self.area), 1e-12)[self.owner]
        return None

    def _sums(self, value: Array) -> Array:
        return np.bincount(self.owner, value, minlength=len(self.grain_m))

    def pressure(self, point_m: Array, pressure_pa: Array, moment: Moment) -> Array:
        borne = self._sums(pressure_pa * self.area)[self.owner] * self.spot
        return np.asarray(pressure_pa + self.size * (borne - pressure_pa))


class PoissonStrain(Unlisted):
    """The dent stretches the cloth outwards: about a press it conducts worse towards it and better around it."""

    name, source, largest = "poisson_strain", "Smith, Phys. Rev. 94, 1954: piezoresistance is a tensor", 1.6

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.deep_m = _deepest_m(skin)

    def pressure(self, point_m: Array, pressure_pa: Array, moment: Moment) -> Array:
        self.at = moment
        return pressure_pa

    def direction(self, point_m: Array, pressure_pa: Array) -> Array:
        tensor = np.broadcast_to(np.eye(2), (len(point_m), 2, 2))
        for place, depth in zip(self.at.position_m, self.at.depth_m, strict=True):
            radius = np.hypot(*(point_m - place).T) + 1e-9
            outwards = (point_m - place) / radius[:, None]
            share = self.size * (depth / self.deep_m) ** 2 * np.exp(-(((radius - 0.007) / 0.0035) ** 2))
            # exp of a symmetric traceless 2x2 matrix whose square is 1.
            turned = 2.0 * outwards[:, :, None] * outwards[:, None, :] - np.eye(2)
            tensor = tensor @ (np.cosh(share)[:, None, None] * np.eye(2) - np.sinh(share)[:, None, None] * turned)
        return np.asarray(tensor)


class GrowingBlister(Unlisted):
    """The patch peels off the sheet a little farther with every press; pressed upon it touches again."""

    name, source, largest = "growing_blister", "Hutchinson and Suo, Adv. Appl. Mech. 29, 1992: delamination", 2.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.center, self.count = _pressed(skin, rng, 0.004), len(skin.plan.presses)
        self.scale_pa = 0.03 * skin.law.top_pa

    def pressure(self, point_m: Array, pressure_pa: Array, moment: Moment) -> Array:
        self.open = 1.0 - np.tanh(np.maximum(pressure_pa, 0.0) / self.scale_pa)
        return pressure_pa

    def sheet(self, point_m: Array, moment: Moment) -> Array:
        edge_m = 0.004 + 0.012 * np.sqrt(moment.press / self.count)
        radius = np.hypot(*(point_m - self.center).T)
        return np.asarray(-self.size * self.open * 0.5 * (1.0 - np.tanh((radius - edge_m) / 0.002)))


KINDS: tuple[type[Unlisted], ...] = (
    WetPatch,
    CreasedSheet,
    BreakingThreads,
    WornCoating,
    GritUnderSheet,
    PoissonStrain,
    GrowingBlister,
)
