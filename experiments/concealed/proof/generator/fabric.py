"""What the piezoresistive pair does beyond a law of pressure: memory in two and three forms, maps that are no noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .effect import Effect
from .fields import MAPS
from .memory import AdheringContacts, Ageing, ColemanHodgdon, Spectrum, fractional, stretched
from .skin import Skin

Array = NDArray[np.float64]


def triangle(top_pa: float, steps: int = 80) -> Array:
    """A slow cycle from nothing to ``top_pa`` and back."""
    return np.concatenate([np.linspace(0, top_pa, steps), np.linspace(top_pa, 0, steps)[1:]])


class _Loop(Effect):
    """A rate-independent memory of pressure."""

    name = "piezo_hysteresis"

    def meaning(self, skin: Skin) -> dict[str, float]:
        """Widest gap between the branches of a full cycle, over the span of resistance."""
        top, steps = 0.8 * skin.law.top_pa, 80
        self.start(1)
        felt = np.array([self.felt(np.array([p]), 0.5)[0] for p in triangle(top, steps)])
        resistance = np.exp(-skin.law.log_gain(felt))
        up, down = resistance[:steps], resistance[steps - 1 :][::-1]
        return {"loop_width": float(np.max(np.abs(up - down)) / np.ptp(resistance))}


class AdheringFabric(_Loop):
    """Fibres pressed together let go later than they met."""

    form = "preisach_adhesion"
    source = "Mayergoyz, Phys. Rev. Lett. 56, 1986; Fuller and Tabor, Proc. R. Soc. A 345, 1975"
    largest = 0.8

    def start(self, points: int) -> None:
        self.contacts = AdheringContacts(1.0 - self.size, points)

    def felt(self, pressure_pa: Array, since_s: float) -> Array:
        return self.contacts.advance(pressure_pa)


class DuhemFabric(_Loop):
    """A smooth lag whose rise and fall have their own differential equations."""

    form, source = "coleman_hodgdon", "Coleman and Hodgdon, Int. J. Eng. Sci. 24, 1986"
    largest = 0.9

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.scale_pa = 0.25 * skin.law.top_pa

    def start(self, points: int) -> None:
        self.lag = ColemanHodgdon(self.scale_pa, 1.0 - self.size, points)

    def felt(self, pressure_pa: Array, since_s: float) -> Array:
        return np.maximum(self.lag.advance(pressure_pa), 0.0)


class _Creep(Effect):
    name = "piezo_creep"

    def meaning(self, skin: Skin) -> dict[str, float]:
        """Share by which conductance gained grows on in 10 s of hold at half the law's span, after a rise of 2 s."""
        self.start(1)
        p = np.array([0.5 * skin.law.top_pa])
        u = skin.law.log_gain(p)
        first = float(self.gain(u, p, 2.0)[0])
        last = float(self.gain(u, p, 10.0)[0])
        return {"share_crept": (last - first) / float(u[0])}


class StretchedCreep(_Creep):
    """Conductance gained goes on growing, by a stretched exponential of the time under load."""

    form = "kohlrausch"
    source = "Kohlrausch, Ann. Phys. 167, 1854; Phillips, Rep. Prog. Phys. 59, 1996"
    largest = 1.5

    def growth(self, t: Array) -> Array:
        return stretched(t, 12.0, 0.5)

    def start(self, points: int) -> None:
        self.late = Spectrum(self.growth, points)

    def gain(self, log_gain: Array, pressure_pa: Array, since_s: float) -> Array:
        return np.asarray(log_gain + self.size * self.late.advance(log_gain, since_s))


class FractionalCreep(StretchedCreep):
    """The same by a springpot in a Kelvin chain: a power of time at first."""

    form = "fractional_kelvin"
    source = "Curie 1889 and von Schweidler 1907; Mainardi, Fractional Calculus and Waves, 2010"

    def growth(self, t: Array) -> Array:
        return fractional(t, 30.0, 0.4)


class AgeingCreep(_Creep):
    """Contacts grow with the logarithm of the time they have been held, and age anew once the load changes."""

    form = "ageing_log_time"
    source = "Dieterich, J. Geophys. Res. 77, 1972; Ruina, J. Geophys. Res. 88, 1983"

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.least_pa = 0.004 * skin.law.top_pa

    def start(self, points: int) -> None:
        self.age = Ageing(self.least_pa, 6.0, points)

    def gain(self, log_gain: Array, pressure_pa: Array, since_s: float) -> Array:
        age = self.age.advance(pressure_pa, since_s)
        return np.asarray(log_gain * (1.0 + self.size * np.log1p(age / 0.5) / np.log(21.0)))


# ------------------------------------------------------------------------------------------------------------ maps


class MappedSensitivity(Effect):
    """How much conductance a pressure gains differs over the sheet, after one of the maps."""

    name = "piezo_inhomogeneity"
    map_name = "seam"
    largest = 1.2

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        self.map = MAPS[self.map_name](rng, *skin.box_m)
        self.details["map"] = sampled(self.map, skin)

    def sensitivity(self, point_m: Array) -> Array:
        return np.exp(self.size * np.clip(self.map(point_m), -2.0, 2.0))

    def meaning(self, skin: Skin) -> dict[str, float]:
        """Spread of the logarithm of sensitivity over the sensing points."""
        return {"log_spread": float(np.std(np.log(self.sensitivity(skin.taxel_m))))}


def sampled(field: object, skin: Skin) -> list[float]:
    """A map at the sheet's sensing points."""
    return [round(float(v), 4) for v in field(skin.taxel_m)]  # type: ignore[operator]


class SeamSensitivity(MappedSensitivity):
    form, source, map_name = "seam", "paper II-A: patches glued side by side, double where they overlap", "seam"


class LotSensitivity(MappedSensitivity):
    form, source, map_name = "patch_lots", "paper II-A: discrete patches; lots differ", "lots"


class WrinkledSensitivity(MappedSensitivity):
    form, source, map_name = "wrinkles", "Cerda and Mahadevan, Phys. Rev. Lett. 90, 2003", "wrinkles"


class HillSensitivity(MappedSensitivity):
    form, source, map_name = "hills", "paper IV, Fig. 8: a corner of the sheet is more sensitive", "hills"
