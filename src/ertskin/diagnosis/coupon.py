"""A foam coupon alone: which foam effects its compression test shows.

The elastic curve's shape is free: it is the coupon's calibration. What is named is memory. The fast cycles are fitted
and decide what is named; a slow ramp and hold, where there is one, is predicted and only weighs how sure the names are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.claims import (
    MATERIAL_RATIO,
    QUANTILE,
    Claim,
    Diagnosis,
    Estimate,
    HeldOut,
    confidences,
    verdict_of,
)
from ertskin.diagnosis.compression import Compression, prepared
from ertskin.diagnosis.coupon_drawing import coupon_figure
from ertskin.diagnosis.coupon_fit import CouponModel, elastic_model, fit_coupon, memory, rmse_n
from ertskin.diagnosis.drawn import DrawnFindings
from ertskin.diagnosis.findings import Findings
from hardware.measurement import Coupon
from physics.effects.effect import FoamEffect
from physics.effects.foam_hysteresis import FoamHysteresis
from physics.effects.foam_softening import FoamSoftening
from physics.effects.viscoelastic_foam import ViscoelasticFoam

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

RELAXATION = ViscoelasticFoam(fraction=0.2, time_s=10.0, remembers_air=True)
HYSTERESIS = FoamHysteresis(loss=0.05, reversal=1.0, driven_by="sinking")
SOFTENING = FoamSoftening(excess=0.3, kept=0.0, presses=0.05, rejoin=0.5)
FORM: tuple[FoamEffect, ...] = (RELAXATION, HYSTERESIS, SOFTENING)
"""The effects and where their fit starts; the form is chosen in experiments/real/foam, by other specimens."""
TWIN = ViscoelasticFoam(fraction=0.2, time_s=10.0, slow_fraction=0.15, slow_time_s=1.0, remembers_air=True)
"""A second relaxation time does much of what hysteresis does in cycles of one speed."""
SHAPE = frozenset({"foam_softening.kept", "foam_softening.presses"})
HELD = SHAPE | {"viscoelastic_foam.slow_fraction", "viscoelastic_foam.slow_time_s"}
"""Parameters of the effects that stay at their start."""
WORSE = 1.02
"""Misfit of later cycles, over that with the effect, from which an effect is needed."""
FEW = 50


@dataclass(frozen=True, eq=False)
class Trial:
    """A form fitted to the fast cycles, and to the earlier of them alone; rms errors in newton."""

    model: CouponModel
    inside_n: float
    later_n: float
    out_n: float
    alike: float

    def shortfall(self, best: Trial, samples: int) -> float:
        """Half chi-square by which this explains less than ``best``, both fitted to ``samples`` samples.

        Samples count as far as they are independent, the part held out as two readings: a ramp and a hold.
        """
        fast = samples / best.alike * np.log(self.inside_n / best.inside_n)
        return float(fast + (self.out_n**2 - best.out_n**2) / max(best.out_n, best.inside_n) ** 2)


def diagnose_coupon(coupon: Coupon, name: str) -> Findings:
    """Which effects the fast cycles show, and how well they predict the part of the test that no fit has seen."""
    test = prepared(coupon)
    cycles = np.unique(test.cycle[test.fast & (test.cycle > 0)])
    if len(cycles) < 3:
        held = HeldOut("none", None, None, None, None)
        reason = f"{len(cycles)} loading cycle{'s' * (len(cycles) != 1)}: nothing is left to predict"
        return Findings(Diagnosis(name, "cannot_tell", held, reason=reason))
    fitted, out, split = regimes(test)
    elastic = elastic_model([test], [fitted])
    noise = coupon_noise_n(test)
    before = rmse_n(elastic, test, out)
    form, trial = FORM, tried(test, fitted, out, FORM, HELD)
    without = {e.name: tried(test, fitted, out, tuple(o for o in form if o is not e), HELD) for e in form}
    while form:
        idle = [e for e in form if not _needed(without[e.name], trial, int(fitted.sum()))]
        if not idle:
            break
        least = min(idle, key=lambda e: without[e.name].inside_n)
        trial, form = without[least.name], tuple(e for e in form if e is not least)
        without = {e.name: tried(test, fitted, out, tuple(o for o in form if o is not e), HELD) for e in form}
    claims = tuple(_claim(test, (fitted, out), trial, without[effect.name], effect) for effect in trial.model.effects)
    after = trial.out_n if claims else before
    verdict = verdict_of(before / noise, after / noise, bool(claims), other_mismatch=False)
    caption = f"Shaded: held out ({split}). The elastic curve's shape is free in both."
    return DrawnFindings(
        Diagnosis(
            name,
            verdict,
            HeldOut(split, None, before / noise, after / noise, None, before, after),
            stage="mechanics" if claims or verdict == "unexplained" else None,
            depends_on=("history", "force") if claims else (),
            claims=claims,
            unexplained_ratio=after / noise,
            unexplained_depends_on=("history",) if after > MATERIAL_RATIO * noise else (),
        ),
        drawings=(("The compression test", caption, lambda: coupon_figure(test, out, elastic, trial.model)),),
    )


def regimes(test: Compression) -> tuple[Rows, Rows, str]:
    """(N,) samples fitted, (N,) samples held out, and what the split is.

    Before the first loading the plate already rests on the foam and the load cell was zeroed there: never fitted.
    """
    fast = test.fast & (test.cycle > 0)
    if (~test.fast).sum() > FEW:
        return fast, ~test.fast, "slow ramp and hold, fitted on the fast cycles"
    early = earlier(test, fast)
    return early, fast & ~early, "the last third of the cycles"


def earlier(test: Compression, rows: Rows) -> Rows:
    """(N,) those of the samples ``rows`` that lie in the first two thirds of their cycles."""
    return np.asarray(rows & (test.cycle <= np.quantile(np.unique(test.cycle[rows]), 2 / 3)))


def tried(test: Compression, fitted: Rows, out: Rows, form: tuple[FoamEffect, ...], held: frozenset[str]) -> Trial:
    """A form's fit and its errors on what was fitted, on later cycles of it, and on what was held out."""
    early = earlier(test, fitted)
    whole = fit_coupon([test], [fitted], form, held)
    part = fit_coupon([test], [early], form, held)
    residual = (whole.force_n(test) - test.force_n)[fitted]
    return Trial(
        whole,
        rmse_n(whole, test, fitted),
        rmse_n(part, test, fitted & ~early),
        rmse_n(whole, test, out),
        memory(residual),
    )


def _needed(without: Trial, trial: Trial, samples: int) -> bool:
    """Whether leaving an effect out costs more than its parameters are worth, and predicts later cycles worse."""
    independent = samples / trial.alike
    gain = independent * np.log(without.inside_n / trial.inside_n)
    freed = len(trial.model.names) - len(without.model.names)
    return bool(gain > 0.5 * freed * np.log(independent) and without.later_n > WORSE * trial.later_n)


def _claim(test: Compression, split: tuple[Rows, Rows], trial: Trial, without: Trial, effect: FoamEffect) -> Claim:
    samples = int(split[0].sum())
    rivals = [("none", without.shortfall(trial, samples))]
    if effect.name == HYSTERESIS.name:
        rest = tuple(e for e in trial.model.effects if e.name not in (effect.name, TWIN.name))
        rivals.append((TWIN.name, tried(test, *split, (TWIN, *rest), SHAPE).shortfall(trial, samples)))
    confidence, alternatives = confidences(tuple(rivals))
    known, estimates = effect.parameters(), {}
    for key, value in effect.values().items():
        error = QUANTILE * trial.model.error(effect, key)
        if np.isfinite(error):
            low, high = max(value - error, known[key].low), min(value + error, known[key].high)
            estimates[key] = Estimate(value, low, high, known[key].unit)
    ratio = without.out_n / coupon_noise_n(test)
    return Claim(effect, confidence, ratio, estimates, tuple((n, c) for n, c in alternatives if n != "none"))


def coupon_noise_n(test: Compression) -> float:
    """Noise of a force reading, from third differences."""
    jump = np.diff(test.force_n, 3)
    return float(max(1.4826 * np.median(np.abs(jump)) / np.sqrt(20.0), 1e-4))
