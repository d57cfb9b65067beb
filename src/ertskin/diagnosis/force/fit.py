"""The force-depth stage: which effects the load cell shows, fitted with the pad's and support's stiffness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ertskin.physics.effects.effect import FoamEffect, MotionEffect, Parameter
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


def force_starts() -> dict[str, list[ForceEffect]]:
    """Every effect that force over depth shows, by name, where its fits begin."""
    kinds = effects_shown_by(Signal.FORCE)
    return {kind.name: [cast(ForceEffect, start.effect) for start in kind.force_starts()] for kind in kinds}


@dataclass(frozen=True, eq=False)
class ForceData:
    """Forces to explain, each read over a scan of ``scan_s`` seconds: history, ``noise_n``, the support's stiffness and
    its error, the foam's thickness."""

    history: History
    noise_n: float
    support_n_per_m: float
    support_error: float
    foam_m: float
    scan_s: float = 0.0

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
    """A fitted force stage: stiffnesses, effects, predicted forces (T,C), residuals in units of the noise."""

    pad_n_per_m: float
    support_n_per_m: float
    effects: tuple[ForceEffect, ...]
    force_n: Array
    residual: Array
    names: tuple[str, ...]
    value: Array
    covariance: Array

    @property
    def foam(self) -> tuple[FoamEffect, ...]:
        """What of its effects the foam does."""
        return tuple(e for e in self.effects if isinstance(e, FoamEffect))

    @property
    def chi_square(self) -> float:
        """Sum of squared residuals over the frames fitted."""
        return float(np.nansum(self.residual**2))


def free_parameters(effect: ForceEffect) -> dict[str, Parameter]:
    """The continuous parameters a fit may move."""
    return {key: p for key, p in effect.parameters().items() if key not in effect.hypothesis.held}


def fit_force(
    data: ForceData,
    effects: Sequence[ForceEffect],
    rows: NDArray[np.bool_] | None = None,
    start: ForceFit | None = None,
) -> ForceFit:
    """Least squares over the frames ``rows`` (T,); the whole history drives the memories all the same."""
    used = data.used if rows is None else data.used & rows[:, None]
    known = [(effect, key, p) for effect in effects for key, p in free_parameters(effect).items()]
    names = ("pad", "support", *(f"{effect.name}.{key}" for effect, key, _ in known))
    low = np.array([-4.0, -0.5, *(p.low for _, _, p in known)])
    high = np.array([4.0, 0.5, *(p.high for _, _, p in known)])
    scale = np.array([0.1, 0.01, *(p.typical for _, _, p in known)])
    pad_start = _stiffness_n_per_m(data, used)
    pad_begin = 0.0 if start is None else float(np.log(start.pad_n_per_m / pad_start))
    begin = [pad_begin, 0.0, *(float(getattr(effect, key)) for effect, key, _ in known)]

    def model(x: Array) -> tuple[float, float, tuple[ForceEffect, ...], Array]:
        pad, support = float(pad_start * np.exp(x[0])), float(data.support_n_per_m * (1 + x[1]))
        built = _with_values(effects, x[2:])
        return pad, support, built, data.force_n(pad, support, built)

    def residuals(x: Array) -> Array:
        force = model(x)[3]
        wrong = np.clip((force[used] - data.history.force_n[used]) / data.noise_n, -1e4, 1e4)
        return np.append(wrong, x[1] / data.support_error)

    x0 = np.clip(begin, low + INSIDE, high - INSIDE)
    found = least_squares(
        residuals, x0, bounds=(low, high), x_scale=scale, diff_step=1e-4, max_nfev=25, xtol=1e-5, ftol=1e-6
    )
    pad, support, built, force = model(found.x)
    whole = np.where(data.used, (data.history.force_n - force) / data.noise_n, np.nan)
    covariance = np.linalg.pinv(found.jac.T @ found.jac)
    return ForceFit(pad, support, built, force, whole, names, found.x, covariance)


def _with_values(effects: Sequence[ForceEffect], x: Array) -> tuple[ForceEffect, ...]:
    """The effects with their free parameters set to ``x`` (P,), in their order."""
    values = iter(map(float, x))
    return tuple(effect.changed({key: next(values) for key in free_parameters(effect)}) for effect in effects)


def _stiffness_n_per_m(data: ForceData, used: NDArray[np.bool_]) -> float:
    """The pad's, from the contacts' (T,C) mean force over mean depth with the support's yielding taken off."""
    force_n, depth_m = (np.where(used, each, 0.0).sum() for each in (data.history.force_n, data.history.depth_m))
    both = max(force_n / max(depth_m, 1e-12), 1e-3)
    return float(1.0 / max(1.0 / both - 1.0 / data.support_n_per_m, 1e-6))


def select_force_effects(
    data: ForceData, folds: NDArray[np.intp], threshold: float, second_share: float
) -> tuple[ForceFit, ForceFit]:
    """Forward and backward selection by held-out likelihood over the folds (T,) of frames.

    Returns the fits without and with the effects chosen. One enters, and stays, while its gain held out, in half
    chi-square, exceeds ``threshold``, and stays while what is lost without it also exceeds ``second_share`` of what the
    most important one is worth: less may be owed to that one's form.
    """
    base = fit_force(data, ())
    every = force_starts()
    chosen: list[ForceEffect] = []
    best = base
    score = _held_out(data, chosen, folds, base)
    while len(chosen) < len(every):
        gains: dict[str, tuple[float, ForceFit]] = {}
        for name, starts in every.items():
            if name in {e.name for e in chosen}:
                continue
            fits = [fit_force(data, [*best.effects, s], start=best) for s in starts]
            fit = min(fits, key=lambda f: f.chi_square)
            if best.chi_square - fit.chi_square < 2 * threshold:
                gains[name] = (0.5 * (best.chi_square - fit.chi_square), fit)
                continue
            gains[name] = (score - _held_out(data, fit.effects, folds, fit), fit)
        name, (gain, fit) = max(gains.items(), key=lambda item: item[1][0])
        if gain < threshold:
            break
        chosen = list(fit.effects)
        best, score = fit, score - gain
    return base, _without_the_small(data, best, score, folds, (threshold, second_share))


def _without_the_small(
    data: ForceData, best: ForceFit, score: float, folds: NDArray[np.intp], least: tuple[float, float]
) -> ForceFit:
    """The fit without effects that are worth less than ``least``, in half chi-square and as a share of the largest."""
    while best.effects:
        rests = [[e for e in best.effects if e.name != effect.name] for effect in best.effects]
        fits = [fit_force(data, rest, start=best) for rest in rests]
        losses = [_held_out(data, fit.effects, folds, fit) - score for fit in fits]
        k = int(np.argmin(losses))
        if not losses[k] < max(least[0], least[1] * max(losses)):
            break
        best, score = fits[k], score + losses[k]
    return best


def _held_out(data: ForceData, effects: Sequence[ForceEffect], folds: NDArray[np.intp], start: ForceFit) -> float:
    """Half chi-square of every fold predicted by a fit to the others."""
    total = 0.0
    for fold in np.unique(folds):
        outside = folds != fold
        fit = fit_force(data, effects, outside, start)
        total += 0.5 * float(np.nansum(np.minimum(fit.residual[~outside] ** 2, 1e6)))
    return total
