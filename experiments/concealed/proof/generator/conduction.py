"""What the sheet does beyond conducting alike everywhere, in every direction, at every time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .effect import Effect, Moment
from .fabric import sampled
from .fields import MAPS
from .sheet import Sheet
from .simulate import frames_of
from .skin import Skin

Array = NDArray[np.float64]


class MappedSheet(Effect):
    """Unloaded sheet resistance differs over the sheet, after one of the maps."""

    name = "sheet_inhomogeneity"
    map_name = "rolls"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.map = MAPS[self.map_name](rng, *skin.box_m)
        self.details["map"] = [round(-v, 4) for v in sampled(self.map, skin)]

    def sheet(self, point_m: Array, moment: Moment) -> Array:
        return np.asarray(self.size * self.map(point_m))

    def meaning(self, skin: Skin) -> dict[str, float]:
        """Spread of the logarithm of sheet resistance over the sensing points."""
        return {"log_spread": float(np.std(self.size * self.map(skin.taxel_m)))}


class RollSheet(MappedSheet):
    form, source, map_name = "rolls", "two rolls of cloth joined: coating weight differs by the roll", "rolls"


class SeamSheet(MappedSheet):
    form, source, map_name = "seam", "overlapping cloth conducts as two in parallel", "seam"


class GradientSheet(MappedSheet):
    form, source, map_name = (
        "gradient",
        "a coating bath that runs out along the web",
        "gradient",
    )


class HillSheet(MappedSheet):
    form, source, map_name = "hills", "worn and washed spots", "hills"


def _rotated(angle: Array, stretch: float) -> Array:
    """(n,2,2) unit-determinant tensors that conduct exp(2 stretch) times better along ``angle``."""
    c, s = np.cos(angle), np.sin(angle)
    along, across = np.exp(stretch), np.exp(-stretch)
    xx, yy, xy = along * c**2 + across * s**2, along * s**2 + across * c**2, (along - across) * c * s
    return np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)


class TwoYarnSheet(Effect):
    """Warp and weft of unequal conductance that don't cross squarely: two conductances summed."""

    name, form = "sheet_anisotropy", "skew_weave"
    source = "Peirce, J. Text. Inst. 28, 1937 (plain weave); rule of mixtures for two yarn families"
    largest = 0.9

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.warp = rng.uniform(0, np.pi)
        # Equal yarns that cross squarely are no anisotropy: both depart from that together.
        self.weft = self.warp + 0.5 * np.pi + self.size * rng.choice([-1, 1]) * rng.uniform(0.1, 0.35)

    def tensor(self) -> Array:
        """(2,2) conductance over its mean."""
        total = np.zeros((2, 2))
        for angle, share in ((self.warp, 1.0 + self.size), (self.weft, 1.0 - self.size)):
            way = np.array([np.cos(angle), np.sin(angle)])
            total += share * np.outer(way, way)
        return np.asarray(total / np.sqrt(np.linalg.det(total)))

    def direction(self, point_m: Array, pressure_pa: Array) -> Array:
        return np.broadcast_to(self.tensor(), (len(point_m), 2, 2))

    def meaning(self, skin: Skin) -> dict[str, float]:
        low, high = np.linalg.eigvalsh(self.direction(skin.taxel_m, np.zeros(len(skin.taxel_m)))).mean(axis=0)
        return {"conductance_ratio": float(high / low)}


class BowedSheet(TwoYarnSheet):
    """The weave is bowed: its better direction turns from one selvedge to the other."""

    form, source = "bowed_weave", "ASTM D3882, bow and skew in woven fabrics"
    largest = 1.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.angle, self.bow = rng.uniform(0, np.pi), rng.choice([-1, 1]) * rng.uniform(0.3, 0.6)
        self.low, self.span = skin.box_m[0], skin.box_m[1] - skin.box_m[0]

    def direction(self, point_m: Array, pressure_pa: Array) -> Array:
        across = (point_m - self.low) / self.span
        return _rotated(self.angle + self.bow * (2.0 * across[:, 0] - 1.0), 0.5 * self.size)


class WarmingSheet(Effect):
    """Warmed from one side by the electronics: heat soaks in by Newton's law, later at the far side."""

    name, form = "temperature_drift", "newton_with_gradient"
    source = "Newton's cooling; thermistor law (Steinhart and Hart, Deep-Sea Res. 15, 1968)"
    largest = 0.5

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        angle = rng.uniform(0, 2 * np.pi)
        self.way = np.array([np.cos(angle), np.sin(angle)])
        self.middle, self.half = skin.box_m.mean(axis=0), 0.5 * float(np.max(np.ptp(skin.box_m, axis=0)))
        self.tau_s, self.kelvin = rng.uniform(150.0, 500.0), 12.0

    def sheet(self, point_m: Array, moment: Moment) -> Array:
        near = (point_m - self.middle) @ self.way / self.half
        rise = (1.0 + 0.35 * near) * -np.expm1(-moment.time_s / (self.tau_s * (1.0 - 0.25 * near)))
        warm = 296.0 + self.kelvin * rise
        return np.asarray(self.size * 296.0 / self.kelvin * (1.0 - 296.0 / warm))

    def meaning(self, skin: Skin) -> dict[str, float]:
        """Mean logarithm of conductance gained 300 s after the recording's start."""
        self.start(len(skin.taxel_m))
        moment = Moment(300.0, 0.0, 0, 0, np.zeros((0, 2)), np.zeros(0))
        return {"log_change_300_s": float(np.mean(self.sheet(skin.taxel_m, moment)))}


class LoadWarmedSheet(WarmingSheet):
    """A draught that comes and goes, and a warm indenter that leaves warm places behind."""

    form, source = "draught_and_warm_load", "Carslaw and Jaeger, Conduction of Heat in Solids, 1959, section 10.3"
    bends = True

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        super().draw(skin, rng)
        self.period_s, self.phase = rng.uniform(300.0, 900.0), rng.uniform(0.0, 1.0)

    def start(self, points: int) -> None:
        self.spot = np.zeros(points)

    def sheet(self, point_m: Array, moment: Moment) -> Array:
        slow = np.sin(2 * np.pi * (moment.time_s / self.period_s + self.phase)) - np.sin(2 * np.pi * self.phase)
        self.spot = self.spot * np.exp(-moment.since_s / 60.0)
        for place in moment.position_m:
            near = np.exp(-((point_m - place) ** 2).sum(axis=1) / (2 * 0.012**2))
            self.spot = self.spot + near * -np.expm1(-moment.since_s / 25.0)
        return np.asarray(self.size * (0.6 * slow + 0.5 * self.spot))


class ScanHeatedSheet(Effect):
    """The scan's own currents warm the sheet where they crowd; scans come faster while it is pressed."""

    name, form = "self_heating", "local_balance"
    source = "Joule heat, lumped to the place: Incropera, Heat and Mass Transfer, ch. 5.1"
    spread_m = 0.0
    tau_s: tuple[float, ...] = (20.0,)
    largest = 1.0
    bends = True

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.heat = _joule(skin, self.spread_m)

    def start(self, points: int) -> None:
        self.dose = np.zeros(len(self.tau_s))
        self._heated: tuple[Array, Array] | None = None

    def sheet(self, point_m: Array, moment: Moment) -> Array:
        # The same places are asked for at every moment of a recording; their neighbours are looked up once.
        if self._heated is None or self._heated[0] is not point_m:
            self._heated = point_m, self.heat(point_m)
        return np.asarray(self.size * self._heated[1] * self._stored(moment.since_s, moment.frame >= 0))

    def _stored(self, since_s: float, scanned: bool) -> float:
        """Scans a second, each by the share of its heat that is left, after the step to this moment."""
        # One scan's worth of heat for every frame taken, none while the stage only travels.
        decay = np.exp(-since_s / np.array(self.tau_s))
        self.dose = self.dose * decay + (1.0 / np.array(self.tau_s) if scanned else 0.0)
        return float(self.dose.mean())

    def meaning(self, skin: Skin) -> dict[str, float]:
        """Relative change of the sheet's resistance, its area's mean, in the scan taken 300 s after the first.

        From cold, with nothing pressing. Scans are as far apart as frames of the skin's plan mostly are: the median of
        the times from one frame to the next, rests included. The last scan's own heat counts.
        """
        pace_s = float(np.median(np.diff(frames_of(skin).time_s)))
        self.start(0)
        for _ in range(round(300.0 / pace_s) + 1):
            stored = self._stored(pace_s, True)
        sheet = _coarse(skin)
        gained = self.size * self.heat(sheet.point_m.reshape(-1, 2)) * stored
        change = np.average(np.expm1(-gained), weights=sheet.weight.ravel())
        # Three digits, for elements equally near may change places on another machine (some 1e-5 of the change).
        return {"warmed_300_s": float(f"{change:.3g}")}


class SpreadHeatSheet(ScanHeatedSheet):
    """The same with heat that spreads sideways in the cloth, and a slow base below."""

    form, source = "spreading", "Carslaw and Jaeger, Conduction of Heat in Solids, 1959, section 10.4"
    spread_m, tau_s = 6e-3, (12.0, 90.0)


def _coarse(skin: Skin) -> Sheet:
    """The sheet meshed as finely as its heat needs."""
    return Sheet(skin.outline_m, skin.electrodes, replace(skin.fineness, far_m=3.5e-3, rim_m=9e-4))


def _joule(skin: Skin, spread_m: float):  # type: ignore[no-untyped-def]
    """Heat of one scan by place over its mean over the sheet, at rest; smoothed over ``spread_m``."""
    sheet = _coarse(skin)
    conductance = np.full(sheet.weight.shape, 1.0 / skin.sheet_ohm)
    specific = 1.0 / (skin.contact_ohm * skin.electrodes.extent)
    admittance = np.where(sheet.pad >= 0, specific[sheet.pad] if skin.electrodes.edge_m is None else 0.0, 0.0)
    matrix, per_volt = sheet.reduced(conductance, np.broadcast_to(admittance[:, None], sheet.weight.shape), specific)
    potential = per_volt @ np.linalg.pinv(matrix) @ skin.protocol.current.T
    at = np.einsum("eqad,eak->eqdk", sheet.gradient[:, :1], potential[sheet.dofs])[:, 0]
    heat = (at**2).sum(axis=(1, 2))
    place, area = sheet.point_m.mean(axis=1), sheet.weight.sum(axis=1)
    heat /= (heat * area).sum() / area.sum()
    heat = np.minimum(heat, 12.0)
    tree = cKDTree(place)
    reach = max(spread_m, 2e-3)

    def field(point_m: Array) -> Array:
        distance, near = tree.query(point_m, k=24 if spread_m else 4)
        weight = np.exp(-0.5 * (distance / reach) ** 2) * area[near] + 1e-30
        return np.asarray((heat[near] * weight).sum(axis=1) / weight.sum(axis=1))

    return field
