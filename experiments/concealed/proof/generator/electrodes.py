"""What electrodes do beyond keeping their place and their contact resistance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .effect import Effect, Moment
from .outline import Outline
from .sheet import Electrodes
from .skin import Skin

Array = NDArray[np.float64]
TOLD = 0.1
"""Of several electrodes moved, the truth names those that moved at least this share of the farthest."""


class _Contact(Effect):
    name = "contact_pressure_dependence"

    def meaning(self, skin: Skin) -> dict[str, float]:
        """Contact conductance at half the law's span over that at rest, less one."""
        return {"gain_at_half_span": float(self.admittance(np.ones(1), np.array([0.5 * skin.law.top_pa]))[0] - 1.0)}


class HolmContact(_Contact):
    """Constriction of spots that flow under the load: resistance falls with the root of the local pressure."""

    form, source = "holm_plastic", "Holm, Electric Contacts, 4th ed., 1967, sections 3 and 8"
    largest = 20.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.tight_pa = 0.02 * skin.law.top_pa

    def admittance(self, admittance: Array, pressure_pa: Array) -> Array:
        return np.asarray(
            admittance * (1.0 + self.size * (np.sqrt(1.0 + np.maximum(pressure_pa, 0) / self.tight_pa) - 1.0))
        )


class MikicContact(_Contact):
    """Conductance of rough faces grows with almost the load itself."""

    form, source = "mikic_rough", "Mikic, Int. J. Heat Mass Transfer 17, 1974; Cooper, Mikic and Yovanovich 1969"
    largest = 30.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.scale_pa = 0.15 * skin.law.top_pa

    def admittance(self, admittance: Array, pressure_pa: Array) -> Array:
        return np.asarray(admittance * (1.0 + self.size * (np.maximum(pressure_pa, 0.0) / self.scale_pa) ** 0.95))


class PercolatingContact(_Contact):
    """Stitches meet all at once about one pressure: a threshold, then nothing more."""

    form, source = "percolation", "Kirkpatrick, Rev. Mod. Phys. 45, 1973; Stauffer and Aharony, 1994"
    largest = 30.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.scale_pa = 0.12 * skin.law.top_pa

    def admittance(self, admittance: Array, pressure_pa: Array) -> Array:
        share = (np.maximum(pressure_pa, 0.0) / self.scale_pa) ** 3
        return np.asarray(admittance * (1.0 + self.size * share / (1.0 + share)))


class SlidPad(Effect):
    """A pad, or a stretch of the rim, has slid along the wall it is sewn to, round corners if need be."""

    name, form = "electrode_displacement", "slides_along_wall"
    source = "thread tension draws a stitched pad along its seam"
    largest = 1.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.outline = Outline(skin.outline_m)
        self.number = int(rng.integers(len(skin.electrodes)))
        self.sense = float(rng.choice([-1.0, 1.0]))
        self.wall = self.outline.direction(_centers(skin.electrodes)[self.number])
        self.room_m = 0.35 * _gap(skin.electrodes)
        self.shares = np.eye(len(skin.electrodes))[self.number]
        self.details["electrode"] = self.number

    def electrodes(self, electrodes: Electrodes) -> Electrodes:
        shift = self.size * self.room_m * self.sense * self.shares
        if electrodes.edge_m is None:
            return replace(electrodes, center_m=electrodes.center_m + shift[:, None] * self.wall)
        return _slid(electrodes, electrodes.edge_m, self.outline, shift)

    def meaning(self, skin: Skin) -> dict[str, float]:
        """How far the middle of the electrode moved most has moved."""
        dx, dy = (_centers(self.electrodes(skin.electrodes)) - _centers(skin.electrodes))[self.number]
        return {"dx_m": float(dx), "dy_m": float(dy)}


class PulledThread(SlidPad):
    """One thread runs under three pads in a row; all have moved along it, the middle one most."""

    form, source = "pulled_thread", "capstan: Euler 1769, tension falls along a thread under friction"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        super().draw(skin, rng)
        centers = _centers(skin.electrodes)
        near = np.argsort(np.hypot(*(centers - centers[self.number]).T))[:3]
        self.shares[near] = np.maximum(self.shares[near], 0.4)
        self.details["electrodes"] = np.flatnonzero(self.shares >= TOLD * self.shares.max()).tolist()


def _centers(electrodes: Electrodes) -> Array:
    return electrodes.center_m if electrodes.edge_m is None else electrodes.edge_m.mean(axis=1)


def _gap(electrodes: Electrodes) -> float:
    """Least distance between two electrodes' centres."""
    centers = _centers(electrodes)
    distance = np.hypot(*(centers[:, None] - centers[None]).transpose(2, 0, 1)) + np.eye(len(centers))
    return float(distance.min())


def _slid(electrodes: Electrodes, edge_m: Array, outline: Outline, shift_m: Array) -> Electrodes:
    """Stretches of the outline moved along it as they are: both ends by the same way, so that lengths stay."""
    ends = outline.way(edge_m.reshape(-1, 2)) + np.repeat(shift_m, 2)
    moved = np.where(shift_m[:, None, None] == 0.0, edge_m, outline.at(ends).reshape(edge_m.shape))
    return replace(electrodes, edge_m=moved, length_m=electrodes.extent)


class OxidisingContacts(Effect):
    """Some contacts tarnish: a film grows with the root of time (Wagner) and its resistance with it."""

    name, form = "contact_drift", "parabolic_tarnish"
    source = "Wagner, Z. Phys. Chem. B 21, 1933; Braunovic et al., Electrical Contacts, 2007, ch. 4"
    largest = 30.0

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        count = len(skin.electrodes)
        self.rate = np.where(rng.random(count) < 0.2, rng.uniform(0.5, 1.5, count), 0.0)
        self.rate[int(rng.integers(count))] = 1.2
        self.details["electrodes"] = np.flatnonzero(self.rate).tolist()

    def contact(self, contact_ohm: Array, moment: Moment) -> Array:
        return np.asarray(contact_ohm * (1.0 + self.size * self.rate * np.sqrt(moment.time_s / 300.0)))

    def meaning(self, skin: Skin) -> dict[str, float]:
        """Largest change of a contact in 300 s, as a share."""
        moment = Moment(300.0, 0.0, 0, 0, np.zeros((0, 2)), np.zeros(0))
        change = self.contact(np.ones(len(self.rate)), moment) - 1.0
        return {"largest_share_300_s": float(change[np.argmax(np.abs(change))])}


class SettlingContacts(OxidisingContacts):
    """Threads settle into the cloth: contacts improve or loosen with the logarithm of time."""

    form, source = "log_settling", "Holm 1967, section 9: contact load relaxes with the logarithm of time"
    largest = 0.9

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        super().draw(skin, rng)
        self.rate = self.rate * rng.choice([-1.0, 1.0], len(self.rate))

    def contact(self, contact_ohm: Array, moment: Moment) -> Array:
        grown = np.log1p(moment.time_s / 8.0) / np.log1p(300.0 / 8.0)
        return np.asarray(contact_ohm * np.exp(self.size * self.rate * grown))
