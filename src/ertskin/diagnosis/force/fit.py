"""The force-depth stage: which effects the load cell shows, fitted with the pad's and support's stiffness."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ertskin.diagnosis.force.remainder import Remainder
from ertskin.physics.effects.effect import FoamEffect, MotionEffect, Start
from ertskin.physics.effects.hypothesis import Signal
from ertskin.physics.effects.registry import effects_shown_by
from ertskin.physics.history import History
from ertskin.physics.mechanics.reaction import foam_force_n

Array = NDArray[np.float64]

ForceEffect = FoamEffect | MotionEffect
"""What force over depth shows: what the foam does, and a stage that moves while force and scan are read."""
INSIDE = 1e-9
"""How far within its bounds a fit begins."""
MOMENTS = 5
"""Moments of a scan whose depths are averaged where the stage moves."""


def force_starts() -> dict[str, list[Start]]:
    """Every effect that force over depth shows, by name, where its fits begin."""
    return {kind.name: list(kind.force_starts()) for kind in effects_shown_by(Signal.FORCE)}


@dataclass(frozen=True, eq=False)
class ForceData:
    """Forces to explain, each read over a scan of ``scan_s`` seconds: history, ``noise_n``, the support's stiffness and
    its error, the foam's thickness; ``in_readings`` what the skin's readings gain with an effect of a name, in half
    chi-square, which counts for every set that has it."""

    history: History
    noise_n: float
    support_n_per_m: float
    support_error: float
    foam_m: float
    scan_s: float = 0.0
    in_readings: Mapping[str, float] = field(default_factory=dict)

    def by_readings(self, terms: Sequence[Start]) -> float:
        """Half chi-square that the readings gain with the effects of these terms."""
        return sum(self.in_readings.get(term.effect.name, 0.0) for term in terms)

    def force_n(self, pad_n_per_m: float, support_n_per_m: float, effects: Sequence[ForceEffect]) -> Array:
        """(T,C) newton, at the depths where a stage that moves is on average while it is scanned."""
        foam = [e for e in effects if isinstance(e, FoamEffect)]
        moving = [e for e in effects if isinstance(e, MotionEffect)]
        moments = np.linspace(0.0, self.scan_s, MOMENTS)
        depth_m = moving[0].depth_m(self.history, moments).mean(axis=1) if moving else None
        return foam_force_n(self.history, pad_n_per_m, support_n_per_m, self.foam_m, foam, depth_m)

    @property
    def used(self) -> NDArray[np.bool_]:
        """(T,C) contacts whose force and depth are both known."""
        return self.history.touched & np.isfinite(self.history.force_n) & np.isfinite(self.history.depth_m)


@dataclass(frozen=True, eq=False)
class ForceFit:
    """A fitted force stage: stiffnesses, effects with what of them is free, predicted forces (T,C), residuals (T,C) in
    units of the noise, and what no effect explains of them.

    ``misfit``: minus the logarithm of the likelihood of forces and readings, constants apart.
    """

    pad_n_per_m: float
    support_n_per_m: float
    terms: tuple[Start, ...]
    force_n: Array
    residual: Array
    misfit: float
    names: tuple[str, ...]
    value: Array
    covariance: Array
    remainder: Remainder | None = None

    @property
    def effects(self) -> tuple[ForceEffect, ...]:
        """Foam and stage as fitted."""
        return tuple(cast(ForceEffect, term.effect) for term in self.terms)

    @property
    def foam(self) -> tuple[FoamEffect, ...]:
        """What of its effects the foam does."""
        return tuple(e for e in self.effects if isinstance(e, FoamEffect))

    @property
    def chi_square(self) -> float:
        """Sum of squared residuals over the frames fitted."""
        return float(np.nansum(self.residual**2))

    @property
    def information(self) -> float:
        """Schwarz's criterion, halved: less is better."""
        return self.misfit + 0.5 * len(self.value) * float(np.log(np.isfinite(self.residual).sum()))


def fit_force(
    data: ForceData,
    terms: Sequence[Start],
    rows: NDArray[np.bool_] | None = None,
    start: ForceFit | None = None,
) -> ForceFit:
    """Least squares over the frames ``rows`` (T,); the whole history drives the memories all the same.

    What ``start`` leaves to no effect is left here too.
    """
    used = data.used if rows is None else data.used & rows[:, None]
    known = [(term.effect, key, term.effect.parameters()[key]) for term in terms for key in term.free]
    names = ("pad", "support", *(f"{effect.name}.{key}" for effect, key, _ in known))
    low = np.array([-4.0, -0.5, *(p.low for _, _, p in known)])
    high = np.array([4.0, 0.5, *(p.high for _, _, p in known)])
    scale = np.array([0.1, 0.01, *(p.typical for _, _, p in known)])
    pad_start = _stiffness_n_per_m(data, used)
    pad_begin = 0.0 if start is None else float(np.log(start.pad_n_per_m / pad_start))
    begin = [pad_begin, 0.0, *(float(getattr(effect, key)) for effect, key, _ in known)]
    remainder = None if start is None else start.remainder
    nameless = None if remainder is None else remainder.rows(used[data.used])

    def model(x: Array) -> tuple[float, float, tuple[Start, ...], Array]:
        pad, support = float(pad_start * np.exp(x[0])), float(data.support_n_per_m * (1 + x[1]))
        built = _with_values(terms, x[2:])
        return pad, support, built, data.force_n(pad, support, [cast(ForceEffect, term.effect) for term in built])

    def residuals(x: Array) -> Array:
        wrong = np.clip((model(x)[3][used] - data.history.force_n[used]) / data.noise_n, -1e4, 1e4)
        return np.append(wrong if nameless is None else nameless.whitened(wrong), x[1] / data.support_error)

    x0 = np.clip(begin, low + INSIDE, high - INSIDE)
    found = least_squares(
        residuals, x0, bounds=(low, high), x_scale=scale, diff_step=1e-4, max_nfev=25, xtol=1e-5, ftol=1e-6
    )
    pad, support, built, force = model(found.x)
    whole = np.where(data.used, (data.history.force_n - force) / data.noise_n, np.nan)
    covariance = np.linalg.pinv(found.jac.T @ found.jac)
    misfit = float(found.cost) - data.by_readings(terms)
    return ForceFit(pad, support, built, force, whole, misfit, names, found.x, covariance, remainder)


def _with_values(terms: Sequence[Start], x: Array) -> tuple[Start, ...]:
    """The terms with their free parameters set to ``x`` (P,), in their order."""
    values = iter(map(float, x))
    return tuple(replace(t, effect=t.effect.changed({key: next(values) for key in t.free})) for t in terms)


def _stiffness_n_per_m(data: ForceData, used: NDArray[np.bool_]) -> float:
    """The pad's, from the contacts' (T,C) mean force over mean depth with the support's yielding taken off."""
    force_n, depth_m = (np.where(used, each, 0.0).sum() for each in (data.history.force_n, data.history.depth_m))
    both = max(force_n / max(depth_m, 1e-12), 1e-3)
    return float(1.0 / max(1.0 / both - 1.0 / data.support_n_per_m, 1e-6))
