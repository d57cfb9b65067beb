"""The bench's foam under the indenter: from the stage's path in time to the force, with what the foam remembers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import erf

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Hyperfoam:
    """Ogden-Hill compressible foam in confined compression, of unit initial slope.

    ``strain_per_m`` says how much nominal strain one metre of sinking makes: nought is a linear foam.
    (Hill, Adv. Appl. Mech. 18, 1978; Storakers, J. Mech. Phys. Solids 34, 1986.)
    """

    strain_per_m: float = 0.0
    alpha: float = 2.0
    beta: float = 0.75

    def sinking_equivalent_m(self, sinking_m: float) -> float:
        """The sinking at which a linear foam would push back as hard."""
        strain = self.strain_per_m * sinking_m
        if strain < 1e-9:
            return sinking_m
        stretch = 1.0 - min(strain, 0.9)
        stress = (2 / self.alpha) * (stretch ** (-self.alpha * self.beta - 1) - stretch ** (self.alpha - 1))
        return float(stress / (2 * (1 + self.beta)) / self.strain_per_m)


@dataclass(frozen=True)
class Prony:
    """Linear viscoelasticity, three terms; the shares are what relaxes away in the end."""

    shares: tuple[float, ...] = ()
    times_s: tuple[float, ...] = ()


@dataclass(frozen=True)
class BoucWen:
    """Rate-independent loss: unloading pushes back with ``loss`` less, turned over within ``turn_m`` of sinking."""

    loss: float = 0.0
    turn_m: float = 2.5e-4


@dataclass(frozen=True)
class Mullins:
    """Ogden-Roxburgh softening on the stored energy (Proc. R. Soc. A 455, 1999): reloading is softer."""

    amount: float = 0.0
    breadth: float = 0.25


@dataclass(frozen=True)
class Foam:
    """The sensor under the indenter: stiffness, support in series, and the four departures from a linear spring."""

    stiffness_n_per_m: float
    support_n_per_m: float
    hyperfoam: Hyperfoam = Hyperfoam()
    prony: Prony = Prony()
    bouc_wen: BoucWen = BoucWen()
    mullins: Mullins = Mullins()


class FoamSpot:
    """One place of the pad while it is pressed; remembers time, direction and the deepest press."""

    def __init__(self, foam: Foam) -> None:
        self.foam = foam
        self._deepest_m = 0.0
        self._elastic_n = 0.0
        self._sinking_m = 0.0
        self._direction = 1.0
        self._relaxing = np.zeros(len(foam.prony.shares))

    @property
    def sinking_m(self) -> float:
        """How far the surface is pressed in now."""
        return self._sinking_m

    def press(self, depth_m: float, seconds: float) -> float:
        """Force (N) after moving evenly to ``depth_m`` within ``seconds``; none while the foam lags behind."""
        support = self.foam.support_n_per_m

        def excess(sinking_m: float) -> float:
            return sinking_m + self._force(sinking_m, seconds)[0] / support - depth_m

        lost = depth_m <= 0.0 or excess(depth_m) <= 0.0
        sinking = max(depth_m, 0.0) if lost else brentq(excess, 0.0, depth_m, xtol=1e-11)
        force, self._elastic_n, self._direction, self._relaxing = self._force(sinking, seconds)
        self._sinking_m = sinking
        self._deepest_m = max(self._deepest_m, sinking)
        if depth_m <= 0.0:
            self._direction = 1.0
        return 0.0 if lost else force

    def _elastic(self, sinking_m: float) -> float:
        foam = self.foam
        force = foam.stiffness_n_per_m * foam.hyperfoam.sinking_equivalent_m(sinking_m)
        if foam.mullins.amount > 0.0 and self._deepest_m > sinking_m:
            stored, most = sinking_m**2, self._deepest_m**2
            force *= 1.0 - foam.mullins.amount * erf((most - stored) / (foam.mullins.breadth * most))
        return force

    def _force(self, sinking_m: float, seconds: float) -> tuple[float, float, float, Array]:
        foam = self.foam
        direction, moved = self._direction, sinking_m - self._sinking_m
        if foam.bouc_wen.loss > 0.0 and moved != 0.0:
            aim = 1.0 if moved > 0 else -1.0
            direction = aim + (direction - aim) * np.exp(-abs(moved) / foam.bouc_wen.turn_m)
        elastic = self._elastic(sinking_m) * (1.0 - foam.bouc_wen.loss * (1.0 - direction) / 2)
        relaxing, force = self._relaxing, elastic
        if len(relaxing):
            times = np.array(foam.prony.times_s)
            fade = np.exp(-seconds / times)
            fresh = (1.0 - fade) * times / max(seconds, 1e-12)
            relaxing = relaxing * fade + fresh * (elastic - self._elastic_n)
            shares = np.array(foam.prony.shares)
            force = elastic * (1.0 - shares.sum()) + float(shares @ relaxing)
        return float(force), elastic, direction, relaxing
