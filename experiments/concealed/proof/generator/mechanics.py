"""What the pad, the foam and the stage do beyond the linear layered pad: five names, two forms each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from .effect import Effect, Moment
from .foam import FoamPart
from .memory import Spectrum, fractional, quasilinear
from .skin import Skin

Array = NDArray[np.float64]


class _Part:
    """A foam part that changes nothing and remembers nothing."""

    stiffens = False

    def begin(self, position_m: Array, stiffness_n_per_m: float, height_m: float) -> None:
        self.stiffness, self.height = stiffness_n_per_m, height_m

    def settle(self, force_n: float, sunk_m: float, since_s: float) -> None:
        """Nothing to keep."""


# ------------------------------------------------------------------------------------------------- stiffening foam


class _Densifying(_Part):
    stiffens = True

    def __init__(self, size: float) -> None:
        self.size = size

    def force(self, force_n: float, sunk_m: float, since_s: float) -> float:
        share = min(max(sunk_m, 0.0) / (1.25 * self.height), 0.95)
        return force_n * (1.0 + self.size * (share**1.6 / (1.0 - share)))


class DensifyingFoam(Effect):
    """Cell walls meet: stress rises towards a lock-up strain."""

    name, form = "nonlinear_foam", "densification"
    source = "Gibson and Ashby, Cellular Solids, 1997, ch. 5; Rusch, J. Appl. Polym. Sci. 13, 1969"
    largest = 8.0

    def foam(self) -> FoamPart:
        return _Densifying(self.size)

    def meaning(self, skin: Skin) -> dict[str, float]:
        return {"stiffening_at_deepest": _stiffening(self.foam(), skin)}


class _Hyperfoam(_Part):
    stiffens = True
    ALPHA = -3.0

    def __init__(self, size: float) -> None:
        self.size = size

    def force(self, force_n: float, sunk_m: float, since_s: float) -> float:
        stretch = 1.0 - min(max(sunk_m, 0.0) / (1.4 * self.height), 0.9)
        if stretch >= 1.0:
            return force_n
        stress = (stretch ** (self.ALPHA - 1.0) - stretch ** (-1.0)) / self.ALPHA
        return force_n * (1.0 + self.size * (-stress / (1.0 - stretch) - 1.0))


class HyperFoam(Effect):
    """Highly compressible hyperelastic foam in confined compression, one Ogden-Hill term with no lateral strain."""

    name, form = "nonlinear_foam", "ogden_hill"
    source = "Storåkers, J. Mech. Phys. Solids 34, 1986"
    largest = 3.0

    def foam(self) -> FoamPart:
        return _Hyperfoam(self.size)

    def meaning(self, skin: Skin) -> dict[str, float]:
        return {"stiffening_at_deepest": _stiffening(self.foam(), skin)}


def _stiffening(part: FoamPart, skin: Skin) -> float:
    """Force over linear force, less one, sunk as far as the deepest press."""
    deepest = max(float(np.max(press.depth_m)) for press in skin.plan.presses)
    part.begin(np.zeros(2), 1.0, skin.layers[0].thickness_m)
    return part.force(deepest, deepest, 0.0) / deepest - 1.0


# --------------------------------------------------------------------------------------------------- relaxing foam


class _Relaxing(_Part):
    def __init__(self, spectrum: Spectrum, size: float) -> None:
        self.spectrum, self.size = spectrum, size

    def force(self, force_n: float, sunk_m: float, since_s: float) -> float:
        state, last = self.spectrum.state.copy(), self.spectrum.last.copy()
        delayed = float(self.spectrum.advance(np.array([force_n]), since_s)[0])
        self.spectrum.state, self.spectrum.last = state, last
        return force_n - self.size * delayed

    def settle(self, force_n: float, sunk_m: float, since_s: float) -> None:
        self.spectrum.advance(np.array([force_n]), since_s)


class FractionalFoam(Effect):
    """A fractional Zener body: force relaxes by a Mittag-Leffler function."""

    name, form = "viscoelastic_foam", "fractional_zener"
    source = "Bagley and Torvik, J. Rheol. 27, 1983; Gorenflo and Mainardi, CISM 378, 1997"
    largest = 0.7

    def growth(self, t: Array) -> Array:
        return fractional(t, 4.0, 0.55)

    def foam(self) -> FoamPart:
        return _Relaxing(Spectrum(self.growth, 1), self.size)

    def meaning(self, skin: Skin) -> dict[str, float]:
        return {"share_relaxed": self.size * float(self.growth(np.array([10.0]))[0])}


class QuasilinearFoam(FractionalFoam):
    """Fung's quasi-linear foam: relaxation straight in the logarithm of time between two times."""

    form, source = "quasilinear_log_time", "Fung, Biomechanics, 1981, section 7.6"

    def growth(self, t: Array) -> Array:
        return quasilinear(t, 0.15, 90.0)


# ------------------------------------------------------------------------------------------------------ foam losses


class _BoucWen(_Part):
    YIELD_M = 4e-4

    def __init__(self, size: float) -> None:
        self.size, self.last, self.z = size, 0.0, 0.0

    def begin(self, position_m: Array, stiffness_n_per_m: float, height_m: float) -> None:
        super().begin(position_m, stiffness_n_per_m, height_m)
        self.last, self.z = 0.0, 0.0

    def _friction(self, sunk_m: float) -> float:
        way, steps = sunk_m - self.last, 12
        z = self.z
        for _ in range(steps):
            # Exact for n = 1 and beta = gamma: z goes to the sign of the way exponentially.
            z = np.sign(way) + (z - np.sign(way)) * np.exp(-abs(way) / steps / self.YIELD_M)
        return float(z)

    def force(self, force_n: float, sunk_m: float, since_s: float) -> float:
        return force_n + self.size * self.stiffness * max(sunk_m, 0.0) * self._friction(sunk_m)

    def settle(self, force_n: float, sunk_m: float, since_s: float) -> None:
        self.z, self.last = self._friction(sunk_m), sunk_m


class BoucWenFoam(Effect):
    """A smooth rate-independent friction in proportion to how far the foam is sunk."""

    name, form, source = "foam_hysteresis", "bouc_wen", "Bouc, Acustica 24, 1971; Wen, ASCE EM 102, 1976"
    largest = 0.4

    def foam(self) -> FoamPart:
        return _BoucWen(self.size)

    def meaning(self, skin: Skin) -> dict[str, float]:
        return {"loss_share": _loss(self.foam(), skin)}


class _EnergyUnloading(_Part):
    def __init__(self, size: float) -> None:
        self.size, self.most = size, 0.0

    def begin(self, position_m: Array, stiffness_n_per_m: float, height_m: float) -> None:
        super().begin(position_m, stiffness_n_per_m, height_m)
        self.most = 0.0

    def force(self, force_n: float, sunk_m: float, since_s: float) -> float:
        energy = 0.5 * force_n * max(sunk_m, 0.0)
        most = max(self.most, energy)
        return force_n * (1.0 - self.size * (1.0 - energy / most)) if most > 0 else force_n

    def settle(self, force_n: float, sunk_m: float, since_s: float) -> None:
        self.most = max(self.most, 0.5 * force_n * max(sunk_m, 0.0))


class EnergyUnloadingFoam(BoucWenFoam):
    """Unloading below the loading curve by the energy given back; whole again when let go."""

    form = "energy_unloading"
    source = "LS-DYNA Theory Manual, low-density foam (material 57): its unloading factor"
    largest = 0.7

    def foam(self) -> FoamPart:
        return _EnergyUnloading(self.size)


def _loss(part: FoamPart, skin: Skin) -> float:
    """Work lost over work put in, down to the deepest press and back."""
    deepest = max(float(np.max(press.depth_m)) for press in skin.plan.presses)
    part.begin(np.zeros(2), 1.0, skin.layers[0].thickness_m)
    way = np.concatenate([np.linspace(0, deepest, 60), np.linspace(deepest, 0, 60)[1:]])
    force = []
    for sunk in way:
        force.append(part.force(sunk, sunk, 0.1))
        part.settle(sunk, sunk, 0.1)
    return float(np.trapezoid(force, way) / np.trapezoid(force[:60], way[:60]))


# ---------------------------------------------------------------------------------------------------- softening foam


class _Softening(_Part):
    """Keeps a number by place; a press begins with what earlier ones left nearby."""

    REACH_M = 6e-3

    def __init__(self, size: float) -> None:
        self.size, self.now = size, 0.0
        self.places: list[Array] = []
        self.kept: list[float] = []

    def begin(self, position_m: Array, stiffness_n_per_m: float, height_m: float) -> None:
        super().begin(position_m, stiffness_n_per_m, height_m)
        distance = [float(np.hypot(*(p - position_m))) for p in self.places]
        self.before = max(
            (k * np.exp(-((d / self.REACH_M) ** 2)) for k, d in zip(self.kept, distance, strict=True)), default=0.0
        )
        self.now = self.before
        self.places.append(position_m)
        self.kept.append(self.now)


class _OgdenRoxburgh(_Softening):
    def force(self, force_n: float, sunk_m: float, since_s: float) -> float:
        energy, scale = 0.5 * force_n * max(sunk_m, 0.0), 0.5 * self.stiffness * (0.3 * self.height) ** 2
        return force_n * (1.0 - self.size * float(erf(max(self.before - energy, 0.0) / scale)))

    def settle(self, force_n: float, sunk_m: float, since_s: float) -> None:
        self.now = max(self.now, 0.5 * force_n * max(sunk_m, 0.0))
        self.kept[-1] = self.now


class OgdenRoxburghFoam(Effect):
    """Pseudo-elastic softening below the most energy a place took in an earlier press."""

    name, form, source = "foam_softening", "ogden_roxburgh", "Ogden and Roxburgh, Proc. R. Soc. A 455, 1999"
    largest = 0.6

    def foam(self) -> FoamPart:
        return _OgdenRoxburgh(self.size)

    def meaning(self, skin: Skin) -> dict[str, float]:
        return {"softened_third_press": _softened(self.foam(), skin)}


class _Damage(_Softening):
    def force(self, force_n: float, sunk_m: float, since_s: float) -> float:
        return force_n * (1.0 - self.size * -np.expm1(-self.now))

    def settle(self, force_n: float, sunk_m: float, since_s: float) -> None:
        # Work of one press to 0.8 of the height brings damage to 1 - 1/e of its last value.
        scale = 0.5 * self.stiffness * (0.8 * self.height) ** 2
        last, self.last_sunk = getattr(self, "last_sunk", 0.0), sunk_m
        self.now += max(sunk_m - last, 0.0) * force_n / scale
        self.kept[-1] = self.now


class DamagedFoam(OgdenRoxburghFoam):
    """Domains of the foam give way with the work done on a place, over several presses."""

    form, source = "work_damage", "Qi and Boyce, J. Mech. Phys. Solids 52, 2004; Simo, CMAME 60, 1987"

    def foam(self) -> FoamPart:
        return _Damage(self.size)


def _softened(part: FoamPart, skin: Skin) -> float:
    """Share of the force halfway in that the third of three identical presses of one place lacks of the first.

    The plan's deepest press (the first of them), at a place never pressed before, let go after each run. Halfway in is
    the level recorded on the way in nearest to half its deepest depth: level n/2 of an even number n. The force is what
    is recorded there: after the levels before it, before the step to it has left anything behind.
    """
    press = max(skin.plan.presses, key=lambda one: float(np.max(one.depth_m)))
    halfway, held = int(np.argmin(np.abs(press.depth_m - 0.5 * np.max(press.depth_m)))), []
    for _ in range(3):
        part.begin(np.zeros(2), 1.0, skin.layers[0].thickness_m)
        for level, sunk in enumerate(press.depth_m.tolist()):
            if level == halfway:
                held.append(part.force(sunk, sunk, press.step_s))
            part.settle(sunk, sunk, press.step_s)
        part.settle(0.0, 0.0, press.step_s)
    return float(1.0 - held[2] / held[0])


# ------------------------------------------------------------------------------------------------------- stage frame


class TurnedStage(Effect):
    """The sensor lies turned under the stage, about a corner, besides being shifted."""

    name, form, source = "indenter_offset", "turned", "rigid motion of the plane"
    largest = 0.006

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        low, high = skin.box_m
        self.pivot = low + (high - low) * rng.integers(0, 2, 2)
        self.angle = rng.choice([-1, 1]) * 4.0
        self.way = _unit(rng)
        self.middle = 0.5 * (low + high)

    def shift(self, position_m: Array) -> Array:
        """Displacement (n,2) of commanded places."""
        arm = position_m - self.pivot
        return np.asarray(self.size * (0.7 * self.way + self.angle * np.stack([-arm[:, 1], arm[:, 0]], axis=1)))

    def moved(self, moments: list[Moment]) -> list[Moment]:
        return [replace(m, position_m=m.position_m + self.shift(m.position_m)) for m in moments]

    def meaning(self, skin: Skin) -> dict[str, float]:
        at = np.array([press.position_m[0] for press in skin.plan.presses])
        dx, dy = self.shift(at).mean(axis=0)
        return {"dx_m": float(dx), "dy_m": float(dy)}


class SkewedStage(TurnedStage):
    """The stage's axes aren't square and its screw is long by a share, besides a shift."""

    form, source = "skewed", "Slocum, Precision Machine Design, 1992: squareness and lead errors"

    def shift(self, position_m: Array) -> Array:
        arm = position_m - self.middle
        return np.asarray(self.size * (self.way + np.stack([6.0 * arm[:, 1], 4.0 * arm[:, 1]], axis=1)))


def _unit(rng: np.random.Generator) -> Array:
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([np.cos(angle), np.sin(angle)])
