"""A foam coupon alone: which foam effects its compression test shows.

The elastic curve's shape is free: it is the coupon's calibration. What is named is memory. The fast cycles are fitted
and decide what is named; a slow ramp and hold, where there is one, is predicted and only weighs how sure the names are.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import (
    QUANTILE,
    Claim,
    Diagnosis,
    Estimate,
    HeldOut,
    confidences,
    verdict_of,
)
from ertskin.diagnosis.coupon.compression import Compression, prepared
from ertskin.diagnosis.coupon.figures import coupon_figure
from ertskin.diagnosis.coupon.fit import CouponModel, elastic_model, fit_coupon, memory, rmse_n
from ertskin.diagnosis.criteria import DEFAULT, Criteria
from ertskin.diagnosis.judge.quantities import Spread, stated
from ertskin.diagnosis.judge.result import DrawnFindings, Findings, refused
from ertskin.hardware.measurement import Coupon
from ertskin.physics.effects.effect import FoamEffect, Start
from ertskin.physics.effects.hypothesis import Signal
from ertskin.physics.effects.registry import effects_shown_by
from ertskin.physics.effects.standard import Standard
from ertskin.physics.spikes import noise_on_course

Rows = NDArray[np.bool_]

STARTS: dict[str, tuple[Start, ...]] = {
    kind.name: tuple(kind.coupon_starts()) for kind in effects_shown_by(Signal.COUPON)
}
"""Where the fits of every effect begin: first in the form chosen in experiments/real/foam by other specimens, then in
freer ones, which may do much of what another effect does."""
FORM: tuple[FoamEffect, ...] = tuple(cast(FoamEffect, starts[0].effect) for starts in STARTS.values())
"""The effects in their first form."""


def held_by(starts: Iterable[Start]) -> frozenset[str]:
    """Parameters ("effect.key") that stay as they are in fits that begin there."""
    return frozenset(f"{s.effect.name}.{key}" for s in starts for key in s.effect.parameters() if key not in s.free)


HELD = held_by(starts[0] for starts in STARTS.values())
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


def diagnose_coupon(coupon: Coupon, name: str, criteria: Criteria = DEFAULT) -> Findings:
    """Which effects the fast cycles show, and how well they predict the part of the test that no fit has seen."""
    test = prepared(coupon)
    cycles = np.unique(test.cycle[test.fast & (test.cycle > 0)])
    if len(cycles) < 3:
        return refused(name, f"{len(cycles)} loading cycle{'s' * (len(cycles) != 1)}: nothing is left to predict")
    fitted, out, split = regimes(test)
    elastic = elastic_model([test], [fitted])
    noise = noise_on_course(test.force_n)
    before = rmse_n(elastic, test, out)
    form, trial = FORM, tried(test, fitted, out, FORM, HELD)
    without = {e.name: tried(test, fitted, out, tuple(o for o in form if o is not e), HELD) for e in form}
    while form:
        idle = [e for e in form if not _needed(without[e.name], trial, int(fitted.sum()), criteria)]
        if not idle:
            break
        least = min(idle, key=lambda e: without[e.name].inside_n)
        trial, form = without[least.name], tuple(e for e in form if e is not least)
        without = {e.name: tried(test, fitted, out, tuple(o for o in form if o is not e), HELD) for e in form}
    claims = tuple(_claim(test, (fitted, out), trial, without[e.name], e, criteria) for e in trial.model.effects)
    after = trial.out_n if claims else before
    verdict = verdict_of(before / noise, after / noise, bool(claims), criteria)
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
            unexplained_depends_on=("history",) if after > criteria.mismatch_ratio * noise else (),
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


def _needed(without: Trial, trial: Trial, samples: int, criteria: Criteria) -> bool:
    """Whether leaving an effect out costs more than its parameters are worth, and predicts later cycles worse."""
    independent = samples / trial.alike
    gain = independent * np.log(without.inside_n / trial.inside_n)
    freed = len(trial.model.names) - len(without.model.names)
    worse = without.later_n > criteria.chance_ratio * trial.later_n
    return bool(gain > 0.5 * freed * np.log(independent) and worse)


def _claim(
    test: Compression,
    split: tuple[Rows, Rows],
    trial: Trial,
    without: Trial,
    effect: FoamEffect,
    criteria: Criteria,
) -> Claim:
    samples = int(split[0].sum())
    rivals = [("none", without.shortfall(trial, samples))]
    for other, (first, *freer) in STARTS.items():
        for start in freer if other != effect.name else ():
            rest = tuple(e for e in trial.model.effects if e.name not in (effect.name, other))
            held = held_by(start if s is first else s for s in (several[0] for several in STARTS.values()))
            form = (cast(FoamEffect, start.effect), *rest)
            rivals.append((other, tried(test, *split, form, held).shortfall(trial, samples)))
    confidence, alternatives = confidences(tuple(rivals), criteria)
    known, estimates = effect.parameters(), {}
    for key, value in effect.values().items():
        error = QUANTILE * trial.model.error(effect, key)
        if np.isfinite(error):
            low, high = max(value - error, known[key].low), min(value + error, known[key].high)
            estimates[key] = Estimate(value, low, high, known[key].unit)
    ratio = without.out_n / noise_on_course(test.force_n)
    claim = Claim(effect, confidence, ratio, estimates, tuple((n, c) for n, c in alternatives if n != "none"))
    standard = Standard(np.ones_like, np.nan, float(test.sink_m().max()), test.height_m)
    return stated(claim, standard, Spread.of(estimates))
