"""What the specimen shows by itself: its stress is known, so no pad and no contact can be mistaken for the fabric."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ertskin.diagnosis.contract.claims import Rival
from ertskin.diagnosis.criteria import Criteria
from ertskin.physics.effects.effect import PiezoEffect
from ertskin.physics.effects.hypothesis import Signal
from ertskin.physics.effects.piezo_chain import felt
from ertskin.physics.effects.registry import effects_shown_by

Array = NDArray[np.float64]

ORDER = 9
"""Of the free law: a law that is no fifth-order polynomial is no physics left out."""
STEP = 1e-2
"""Of a parameter's typical size, for derivatives."""
Term = tuple[PiezoEffect, tuple[str, ...]]
"""An effect and the parameters of it that are fitted."""


def specimen_starts() -> list[Term]:
    """Every effect that a specimen shows, where its fits begin."""
    kinds = effects_shown_by(Signal.SPECIMEN)
    return [(cast(PiezoEffect, start.effect), start.free) for kind in kinds for start in kind.specimen_starts()]


@dataclass(frozen=True, eq=False)
class SpecimenTest:
    """N readings in recording order: stress in pascal, resistance in ohm per square, time in second."""

    stress_pa: Array
    resistance_ohm_sq: Array
    time_s: Array

    def residual(self, effects: Sequence[PiezoEffect]) -> Array:
        """(N,) relative residuals with these effects, the law fitted anew."""
        pressure, factor = felt(effects, self.stress_pa[:, None], np.zeros((1, 2)), self.time_s, np.zeros((2, 2)))
        coordinate = 2 * np.clip(pressure[:, 0] / pressure.max(), 0.0, 1.0) - 1
        design = chebyshev.chebvander(coordinate, ORDER) * factor / self.resistance_ohm_sq[:, None]
        law = np.linalg.lstsq(design, np.ones(len(design)), rcond=None)[0]
        return np.asarray(design @ law - 1)


@dataclass(frozen=True, eq=False)
class SpecimenFinding:
    """An effect, the parameters fitted, what else was fitted in its stead, and the parameters' standard errors, as if
    readings were independent."""

    effect: PiezoEffect
    free: tuple[str, ...]
    rivals: tuple[Rival, ...]
    error: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class _Fit:
    """Terms at their best values, fitted together: the ``residual`` (N,) and its derivatives (N,n) by what is free, in
    typical sizes."""

    terms: list[Term]
    residual: Array
    slope: Array

    @property
    def rms(self) -> float:
        return _rms(self.residual)

    def errors(self, noise: float) -> list[tuple[float, ...]]:
        """Standard errors of each term's numbers, for ``noise`` of a reading; infinite where nothing tells them."""
        variance = np.diag(np.linalg.pinv(self.slope.T @ self.slope))
        told = np.abs(self.slope).max(axis=0, initial=0.0) > 0
        error = iter(np.where(told, noise * np.sqrt(variance), np.inf))
        return [tuple(float(next(error)) * effect.known(key).typical for key in free) for effect, free in self.terms]


def specimen_findings(test: SpecimenTest, criteria: Criteria) -> tuple[list[SpecimenFinding], float]:
    """Effects that the specimen's loop shows, the strongest first, and the relative noise that they leave.

    An effect enters, in the form that explains most, when its gain is significant, no less than a form's share of the
    largest gain before it, and material. What the first one's form may have left the readings may still name.
    """
    names = list(dict.fromkeys(effect.name for effect, _ in specimen_starts()))
    rivals: list[tuple[Rival, ...]] = []
    best, largest = _fitted(test, []), 0.0
    while len(best.terms) < len(names):
        taken = {effect.name for effect, _ in best.terms}
        tried = [_best_form(test, best.terms, len(taken), name, criteria) for name in names if name not in taken]
        fits = sorted((fit for fit in tried if fit is not None), key=lambda fit: fit.rms)
        gains = [_gain(best.residual, fit.residual) for fit in fits]
        least = max(criteria.significant_gain, criteria.form_share * largest)
        if not fits or gains[0] < least or best.rms < criteria.material_ratio * fits[0].rms:
            break
        reformed = _reformed(test, fits[0], criteria)
        if len(reformed.terms) < len(fits[0].terms):
            # In its other form the one before leaves the last nothing to explain.
            best = reformed
            break
        largest, best = max(largest, gains[0]), reformed
        others = zip(fits[1:], gains[1:], strict=True)
        rivals.append(tuple(Rival(fit.terms[-1][0], gains[0] - gain) for fit, gain in others))
    freedom = len(best.residual) - ORDER - 1 - best.slope.shape[1]
    noise = float(np.sqrt((best.residual**2).sum() / max(freedom, 1)))
    found = zip(best.terms, rivals, best.errors(noise), strict=True)
    return [SpecimenFinding(*term, others, error) for term, others, error in found], noise


def _reformed(test: SpecimenTest, fit: _Fit, criteria: Criteria) -> _Fit:
    """The same effects, those before the last in their other forms too, for one chosen while another effect was missing
    did its part; without the last where these do as well alone."""
    for number, (effect, _) in enumerate(fit.terms[:-1]):
        other = _best_form(test, fit.terms, number, effect.name, criteria)
        if other is not None and other.rms < fit.rms:
            fit = other
    if len(fit.terms) == 1:
        return fit
    alone = _fitted(test, fit.terms[:-1])
    needed = _gain(alone.residual, fit.residual) > criteria.significant_gain
    return fit if needed and alone.rms >= criteria.material_ratio * fit.rms else alone


def _best_form(test: SpecimenTest, terms: Sequence[Term], number: int, name: str, criteria: Criteria) -> _Fit | None:
    """The terms with the effect of this ``name`` at the place ``number``, in the form that explains most: the best of
    its starts, then freer as long as that gains what is significant. None where another law that follows the stress at
    once explains as much: a dead zone is no creep (two of `final310`)."""

    def fitted(start: Term) -> _Fit:
        return _fitted(test, [*terms[:number], start, *terms[number + 1 :]])

    found = min((fitted(start) for start in specimen_starts() if start[0].name == name), key=lambda fit: fit.rms)
    asked = _freer(*found.terms[number])
    while asked:
        freed = fitted(asked.pop(0))
        if _gain(found.residual, freed.residual) > criteria.significant_gain:
            found = freed
            asked += _freer(*found.terms[number])
    effect, free = found.terms[number]
    static = effect.at_once(free)
    if static is None:
        return found if effect.lags else None
    at_once = fitted((cast(PiezoEffect, static.effect), static.free))
    return found if _gain(at_once.residual, found.residual) > criteria.significant_gain else None


def _freer(effect: PiezoEffect, free: tuple[str, ...]) -> list[Term]:
    return [(cast(PiezoEffect, form.effect), form.free) for form in effect.freer(free)]


def _gain(before: Array, after: Array) -> float:
    """Half the change of -2 log likelihood for noise of unknown size, of residuals (N,)."""
    return float(len(before) * np.log(_rms(before) / max(_rms(after), 1e-12)))


def _fitted(test: SpecimenTest, starts: Sequence[Term]) -> _Fit:
    """The terms at their best values, all fitted together."""
    known = [effect.parameters()[key] for effect, free in starts for key in free]
    low, high, typical = (np.array([getattr(k, name) for k in known]) for name in ("low", "high", "typical"))

    def residual(x: Array) -> Array:
        values = iter(map(float, x))
        return test.residual([effect.changed({key: next(values) for key in free}) for effect, free in starts])

    def slope(x: Array) -> Array:
        # A power of nought is none, and a step near it too small to be any.
        columns = []
        for k in range(len(x)):
            less, more = x.copy(), x.copy()
            less[k], more[k] = max(x[k] - STEP * typical[k], low[k]), min(x[k] + STEP * typical[k], high[k])
            columns.append((residual(more) - residual(less)) / (more[k] - less[k]))
        return np.stack(columns, axis=1)

    if not known:
        return _Fit(list(starts), residual(np.zeros(0)), np.zeros((len(residual(np.zeros(0))), 0)))
    begin = [getattr(effect, key) for effect, free in starts for key in free]
    fit = least_squares(residual, begin, jac=slope, bounds=(low, high), x_scale=typical)
    values = iter(map(float, fit.x))
    terms = [(effect.changed({key: next(values) for key in free}), free) for effect, free in starts]
    return _Fit(terms, np.asarray(fit.fun), np.asarray(fit.jac) * typical)


def _rms(residual: Array) -> float:
    return float(np.sqrt((residual**2).mean()))
