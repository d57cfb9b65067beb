"""A foam coupon alone: which foam effects its compression test shows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

from ertskin.diagnosis.claims import Claim, Diagnosis, Estimate, HeldOut
from ertskin.diagnosis.diagnose import Findings
from hardware.recording import Coupon
from physics.effects.effect import FoamEffect, Strokes
from physics.effects.foam_hysteresis import FoamHysteresis
from physics.effects.foam_softening import FoamSoftening
from physics.effects.nonlinear_foam import NonlinearFoam
from physics.effects.viscoelastic_foam import ViscoelasticFoam

Array = NDArray[np.float64]

SAMPLES = 3000
POWERS = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0)
"""Powers of the strain in the elastic curve; coefficients are not negative."""
LADDER: dict[str, FoamEffect] = {
    "viscoelastic_foam": ViscoelasticFoam(
        fraction=0.2, time_s=1.0, slow_fraction=0.1, slow_time_s=60.0, remembers_air=True
    ),
    "foam_hysteresis": FoamHysteresis(loss=0.05, reversal=0.2),
    "foam_softening": FoamSoftening(excess=0.1, kept=0.5, presses=1.0),
}


@dataclass(frozen=True, eq=False)
class CouponTest:
    """A test thinned to N samples: compression (N,) in metre, force (N,) in newton, which are the fast cycles."""

    time_s: Array
    sink_m: Array
    force_n: Array
    cycle: NDArray[np.int64]
    fast: NDArray[np.bool_]
    height_m: float

    @property
    def strokes(self) -> Strokes:
        """What the foam went through."""
        count = len(self.time_s)
        return Strokes(
            self.sink_m,
            self.sink_m,
            self.time_s,
            np.ones(count, dtype=bool),
            np.zeros(count, dtype=np.intp),
            self.cycle,
            self.height_m,
        )


def thinned(coupon: Coupon, samples: int = SAMPLES) -> CouponTest:
    """Reduce a coupon's test; cycles are told apart where the compression turns, fast ones by their speed."""
    sink = np.clip(coupon.height_m - np.asarray(coupon.gap_m, dtype=float), 0.0, None)
    time_s, force = np.asarray(coupon.time_s, dtype=float), np.asarray(coupon.force_n, dtype=float)
    good = np.isfinite(sink) & np.isfinite(force) & np.isfinite(time_s)
    sink, time_s, force = sink[good], time_s[good], force[good]
    kept = np.unique(np.linspace(0, len(sink) - 1, samples).astype(int))
    depth = sink.max()
    cycle = _cycles(sink, depth)
    fast = np.arange(len(sink)) < _slow_start(time_s, sink, cycle)
    return CouponTest(time_s[kept], sink[kept], force[kept], cycle[kept], fast[kept], coupon.height_m)


def _cycles(sink_m: Array, depth_m: float) -> NDArray[np.int64]:
    """(N,) number of the loading cycle each sample belongs to; a new one begins where the compression is least."""
    number, low = 0, 0
    cycle = np.zeros(len(sink_m), dtype=np.int64)
    waiting = False
    for k, s in enumerate(sink_m):
        if s < 0.25 * depth_m:
            low = k if not waiting or s <= sink_m[low] else low
            waiting = True
        elif waiting and s > 0.5 * depth_m:
            number += 1
            cycle[low:k] = number
            waiting = False
        cycle[k] = number
    return cycle


def _slow_start(time_s: Array, sink_m: Array, cycle: NDArray[np.int64]) -> int:
    """First sample of a last cycle that loads at less than 0.7 of the usual pace; their number without one."""
    pace = []
    for number in np.unique(cycle)[1:]:
        mine = np.flatnonzero(cycle == number)
        top = mine[: int(np.argmax(sink_m[mine] > 0.95 * sink_m[mine].max())) + 1]
        pace.append((sink_m[top[-1]] - sink_m[top[0]]) / max(time_s[top[-1]] - time_s[top[0]], 1e-9))
    if len(pace) > 2 and pace[-1] < 0.7 * np.median(pace[:-1]):
        return int(np.flatnonzero(cycle == cycle.max())[0])
    return len(sink_m)


@dataclass(frozen=True, eq=False)
class CouponModel:
    """Elastic coefficients (non-negative, of ``POWERS`` of the strain) and foam effects."""

    elastic_n: Array
    effects: tuple[FoamEffect, ...]

    def force_n(self, test: CouponTest) -> Array:
        """(N,) predicted force."""
        curve = basis(test) @ self.elastic_n
        return _through(curve, self.effects, test)


def basis(test: CouponTest) -> Array:
    """(N, len(POWERS)) elastic curves."""
    strain = test.sink_m / test.height_m
    return np.asarray(np.stack([(strain / strain.max()) ** p for p in POWERS], axis=1))


def _through(force: Array, effects: tuple[FoamEffect, ...], test: CouponTest) -> Array:
    strokes = test.strokes
    for effect in sorted(effects, key=lambda e: e.order):
        force = effect.reaction_n(force, strokes)
    return force


def fit_coupon(test: CouponTest, effects: tuple[FoamEffect, ...], rows: NDArray[np.bool_]) -> CouponModel:
    """Fit to the samples ``rows`` (N,): the effects by least squares, the elastic curve by non-negative ones."""
    keys = [(k, key) for k, e in enumerate(effects) for key in e.parameters()]
    known = [effects[k].parameters()[key] for k, key in keys]
    shapes = basis(test)

    def built(x: Array) -> tuple[FoamEffect, ...]:
        changed = list(effects)
        for (k, key), value in zip(keys, x, strict=True):
            changed[k] = replace(changed[k], **{key: float(value)})
        return tuple(changed)

    def solved(x: Array) -> tuple[Array, Array]:
        now = built(x)
        # Effects are all but proportional to the force they act on: the curves go through one by one.
        columns = np.stack([_through(shapes[:, p], now, test) for p in range(shapes.shape[1])], axis=1)
        elastic = nnls(columns[rows], test.force_n[rows])[0]
        return elastic, _through(shapes @ elastic, now, test)

    def wrong(x: Array) -> Array:
        return np.asarray(solved(x)[1][rows] - test.force_n[rows])

    if not keys:
        return CouponModel(nnls(shapes[rows], test.force_n[rows])[0], ())
    low, high = np.array([p.low for p in known]), np.array([p.high for p in known])
    start = np.clip([getattr(effects[k], key) for k, key in keys], low + 1e-9, high - 1e-9)
    scale = [p.typical for p in known]
    found = least_squares(wrong, start, bounds=(low, high), x_scale=scale, diff_step=1e-3, max_nfev=40)
    return CouponModel(solved(found.x)[0], built(found.x))


def rmse_n(model: CouponModel, test: CouponTest, rows: NDArray[np.bool_]) -> float:
    """Root mean square error in newton over the samples ``rows``."""
    return float(np.sqrt(((model.force_n(test) - test.force_n)[rows] ** 2).mean()))


def diagnose_coupon(coupon: Coupon, name: str) -> Findings:
    """Which effects lower the error on the part of the test the fit hasn't seen."""
    test = thinned(coupon)
    cycles = np.unique(test.cycle[test.fast])
    if len(cycles) < 3:
        held = HeldOut("none", None, None, None, None)
        reason = f"{len(cycles)} loading cycles: nothing is left to predict"
        return Findings(Diagnosis(name, "cannot_tell", held, reason=reason))
    slow = ~test.fast
    split = "slow ramp and hold, fitted on the fast cycles" if slow.sum() > 50 else "the last third of the cycles"
    out = slow if slow.sum() > 50 else test.cycle > np.quantile(cycles, 2 / 3)
    fitted = ~out
    noise = coupon_noise_n(test)
    elastic = fit_coupon(test, (), fitted)
    current, error = elastic, rmse_n(elastic, test, out)
    before = error
    inside = rmse_n(elastic, test, fitted)
    chosen: list[FoamEffect] = []
    gains: dict[str, float] = {}
    while len(chosen) < len(LADDER):
        trials = []
        for effect in LADDER.values():
            if effect.name not in {e.name for e in chosen}:
                model = fit_coupon(test, (*current.effects, effect), fitted)
                trials.append((rmse_n(model, test, fitted), rmse_n(model, test, out), effect, model))
        best = min(trials, key=lambda t: t[0] + t[1])
        if best[0] > 0.97 * inside or best[1] > 1.02 * error:
            break
        gains[best[2].name] = max(inside / best[0], 1.0)
        chosen.append(best[2])
        inside, error, current = best[0], best[1], best[3]
    claims = tuple(
        Claim(
            effect,
            min(0.95, 1 - 0.5 / max(gains.get(effect.name, 1.0), 1.0) ** 4),
            gains.get(effect.name, 1.0),
            {k: Estimate(v, v, v, effect.parameters()[k].unit) for k, v in effect.values().items()},
        )
        for effect in current.effects
    )
    verdict = "partly_explained" if claims and error > 1.05 * noise else ("explained" if claims else "unexplained")
    held = HeldOut(split, None, before / noise, error / noise, None, before, error)
    stage = "mechanics" if claims else None
    return Findings(
        Diagnosis(
            name,
            verdict,
            held,
            stage=stage,
            depends_on=("history", "force"),
            claims=claims,
            unexplained_ratio=error / noise,
        )
    )


def coupon_noise_n(test: CouponTest) -> float:
    """Noise of a force reading, from third differences."""
    jump = np.diff(test.force_n, 3)
    return float(max(1.4826 * np.median(np.abs(jump)) / np.sqrt(20.0), 1e-4))


__all__ = ["NonlinearFoam", "diagnose_coupon", "fit_coupon", "rmse_n", "thinned"]
