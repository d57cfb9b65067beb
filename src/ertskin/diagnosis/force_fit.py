"""The force-depth stage: which foam effects the load cell shows, fitted with the pad's and support's stiffness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from physics.effects.effect import FoamEffect, Parameter
from physics.effects.foam_hysteresis import FoamHysteresis
from physics.effects.foam_softening import FoamSoftening
from physics.effects.nonlinear_foam import NonlinearFoam
from physics.effects.viscoelastic_foam import ViscoelasticFoam
from physics.history import History
from physics.mechanics.reaction import foam_force_n

Array = NDArray[np.float64]

STARTS: dict[str, list[FoamEffect]] = {
    "nonlinear_foam": [NonlinearFoam(stiffening=0.2)],
    "viscoelastic_foam": [ViscoelasticFoam(fraction=0.1, time_s=2.0), ViscoelasticFoam(fraction=0.1, time_s=20.0)],
    # Where every step turns it right round, nothing tells how fast it turns: no descent comes back from there.
    "foam_hysteresis": [FoamHysteresis(loss=0.05, reversal=0.1), FoamHysteresis(loss=0.01, reversal=0.4)],
    "foam_softening": [
        FoamSoftening(excess=0.1, kept=0.5, presses=0.5),
        FoamSoftening(excess=0.1, kept=1.0, presses=0.5),
    ],
}
HELD = {"slow_fraction", "slow_time_s", "rejoin"}
"""Parameters a skin's recording is too short to free."""


@dataclass(frozen=True, eq=False)
class ForceData:
    """Forces to explain: history, ``noise_n``, the support's stiffness with its error, the foam's thickness."""

    history: History
    noise_n: float
    support_n_per_m: float
    support_error: float
    foam_m: float

    @property
    def used(self) -> NDArray[np.bool_]:
        """(T,C) contacts whose force and depth are both known."""
        return self.history.touched & np.isfinite(self.history.force_n) & np.isfinite(self.history.depth_m)


@dataclass(frozen=True, eq=False)
class ForceFit:
    """A fitted force stage: stiffnesses, effects, predicted forces (T,C), residuals in units of the noise."""

    pad_n_per_m: float
    support_n_per_m: float
    effects: tuple[FoamEffect, ...]
    force_n: Array
    residual: Array
    names: tuple[str, ...]
    value: Array
    covariance: Array

    @property
    def chi_square(self) -> float:
        """Sum of squared residuals over the frames fitted."""
        return float(np.nansum(self.residual**2))


def free_parameters(effect: FoamEffect) -> dict[str, Parameter]:
    """The continuous parameters a fit may move."""
    return {key: p for key, p in effect.parameters().items() if key not in HELD}


def fit_force(
    data: ForceData, effects: Sequence[FoamEffect], rows: NDArray[np.bool_] | None = None, start: ForceFit | None = None
) -> ForceFit:
    """Least squares over the frames ``rows`` (T,); the whole history drives the memories all the same."""
    used = data.used if rows is None else data.used & rows[:, None]
    history = data.history
    names: list[str] = ["pad", "support"]
    low, high, scale = [-4.0, -0.5], [4.0, 0.5], [0.1, 0.01]
    sums = np.where(used, history.force_n, 0.0).sum() / max(np.where(used, history.depth_m, 0.0).sum(), 1e-12)
    pad_start = 1.0 / max(1.0 / max(sums, 1e-3) - 1.0 / data.support_n_per_m, 1e-6)
    begin = [0.0, 0.0] if start is None else [float(np.log(start.pad_n_per_m / pad_start)), 0.0]
    for effect in effects:
        for key, p in free_parameters(effect).items():
            names.append(f"{effect.name}.{key}")
            low.append(p.low)
            high.append(p.high)
            scale.append(p.typical)
            begin.append(float(getattr(effect, key)))
    noise = data.noise_n

    def model(x: Array) -> tuple[float, float, tuple[FoamEffect, ...], Array]:
        pad, support = pad_start * np.exp(x[0]), data.support_n_per_m * (1 + x[1])
        built, k = [], 2
        for effect in effects:
            keys = list(free_parameters(effect))
            built.append(replace(effect, **dict(zip(keys, map(float, x[k : k + len(keys)]), strict=True))))
            k += len(keys)
        force = foam_force_n(history, pad, support, data.foam_m, built)
        return float(pad), float(support), tuple(built), force

    def residuals(x: Array) -> Array:
        force = model(x)[3]
        wrong = np.clip((force[used] - history.force_n[used]) / noise, -1e4, 1e4)
        return np.append(wrong, x[1] / data.support_error)

    margin = 1e-9
    x0 = np.clip(begin, np.array(low) + margin, np.array(high) - margin)
    found = least_squares(
        residuals, x0, bounds=(low, high), x_scale=scale, diff_step=1e-4, max_nfev=25, xtol=1e-5, ftol=1e-6
    )
    pad, support, built, force = model(found.x)
    whole = np.where(data.used, (history.force_n - force) / noise, np.nan)
    hessian = found.jac.T @ found.jac
    return ForceFit(pad, support, built, force, whole, tuple(names), found.x, np.linalg.pinv(hessian))


def select_force_effects(data: ForceData, folds: NDArray[np.intp], threshold: float) -> tuple[ForceFit, ForceFit]:
    """Forward and backward selection by held-out likelihood over the folds (T,) of frames.

    Returns the fits without and with the effects chosen. One enters, and stays, while its gain held out, in half
    chi-square, exceeds ``threshold``.
    """
    base = fit_force(data, ())
    chosen: list[FoamEffect] = []
    best = base
    score = _held_out(data, chosen, folds, base)
    while len(chosen) < len(STARTS):
        gains: dict[str, tuple[float, ForceFit]] = {}
        for name, starts in STARTS.items():
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
    for effect in list(chosen):
        rest = [e for e in best.effects if e.name != effect.name]
        without = fit_force(data, rest, start=best)
        loss = _held_out(data, without.effects, folds, without) - score
        if loss < threshold:
            best, score = without, score + loss
    return base, best


def _held_out(data: ForceData, effects: Sequence[FoamEffect], folds: NDArray[np.intp], start: ForceFit) -> float:
    """Half chi-square of every fold predicted by a fit to the others."""
    total = 0.0
    for fold in np.unique(folds):
        outside = folds != fold
        fit = fit_force(data, effects, outside, start)
        total += 0.5 * float(np.nansum(np.minimum(fit.residual[~outside] ** 2, 1e6)))
    return total
