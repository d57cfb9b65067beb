"""What the specimen shows by itself: its stress is known, so no pad and no contact can be mistaken for the fabric."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
from ertskin.physics.spikes import noise_on_course

Array = NDArray[np.float64]

ORDER = 9
"""Of the free law: a law that is no fifth-order polynomial is no physics left out."""
SECOND = 0.045
"""Part of the residual that the first effect takes away which a second one must: less is owed to the first one's form.
False second effects of the 310 specimens of `final310` take 0.037 at most, of 15 simulated pairs of creep and loop all
but two 0.059 and more."""
STEP = 1e-2
"""Of a parameter's typical size, for derivatives: near a power of nought smaller ones are none."""
NEAR = 0.01
"""Typical sizes within which a number is at the end of its range."""
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
    readings were independent.

    Rivals fall short by as many readings as are: two wrong forms of which one leaves seven times the noise, one nine,
    are as good as one another.
    """

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
        size = np.linalg.norm(self.slope, axis=0)
        scaled = self.slope / np.where(size > 0, size, 1.0)
        variance = np.diag(np.linalg.pinv(scaled.T @ scaled)) / np.where(size > 0, size, 1.0) ** 2
        error = iter(np.where(size > 0, noise * np.sqrt(variance), np.inf))
        return [tuple(float(next(error)) * effect.known(key).typical for key in free) for effect, free in self.terms]


def specimen_findings(test: SpecimenTest, criteria: Criteria) -> tuple[list[SpecimenFinding], float]:
    """Effects that the specimen's loop shows, the strongest first, and the relative noise of a reading, as if readings
    were independent, that they leave.

    An effect enters, in the form that explains most, when its gain is significant and material, and what it takes away
    no less than a part of what the first one does. What that one's form may have left the readings may still name.
    """
    names = list(dict.fromkeys(effect.name for effect, _ in specimen_starts()))
    rivals: dict[str, tuple[Rival, ...]] = {}
    best, first = _fitted(test, []), 0.0
    while len(best.terms) < len(names):
        taken = {effect.name for effect, _ in best.terms}
        tried = [_best_form(test, best.terms, len(taken), name, criteria) for name in names if name not in taken]
        fits = sorted((fit for fit in tried if fit is not None), key=lambda fit: fit.rms)
        gains = [_gain(best.residual, fit.residual) for fit in fits]
        if not fits or gains[0] < criteria.significant_gain or best.rms < criteria.material_ratio * fits[0].rms:
            break
        taken_away = float(np.sqrt(best.rms**2 - fits[0].rms ** 2))
        if taken_away < SECOND * first:
            break
        first, others = first or taken_away, zip(fits[1:], gains[1:], strict=True)
        share = _independent(fits[0].residual)
        rivals[fits[0].terms[-1][0].name] = tuple(
            Rival(fit.terms[-1][0], share * (gains[0] - gain)) for fit, gain in others
        )
        best = _needed(test, _reformed(test, fits[0], criteria), criteria)
        if len(best.terms) < len(fits[0].terms):
            break
    freedom = len(best.residual) - ORDER - 1 - best.slope.shape[1]
    # What a form leaves goes on from reading to reading: so much the less do they tell of the law.
    noise = float(np.sqrt((best.residual**2).sum() / max(freedom, 1) / _independent(best.residual)))
    found = zip(best.terms, best.errors(noise), strict=True)
    return [SpecimenFinding(*term, rivals[term[0].name], error) for term, error in found], noise


def _reformed(test: SpecimenTest, fit: _Fit, criteria: Criteria) -> _Fit:
    """The same effects, those before the last in their other forms too: one chosen while another effect was missing did
    its part."""
    for number, (effect, _) in enumerate(fit.terms[:-1]):
        other = _best_form(test, fit.terms, number, effect.name, criteria)
        if other is not None and other.rms < fit.rms:
            fit = other
    return fit


def _needed(test: SpecimenTest, fit: _Fit, criteria: Criteria) -> _Fit:
    """The fit without a term that the others have made superfluous in the forms that they have come to."""
    for number in range(len(fit.terms) if len(fit.terms) > 1 else 0):
        without = _fitted(test, [*fit.terms[:number], *fit.terms[number + 1 :]])
        gain = _gain(without.residual, fit.residual)
        if gain < criteria.significant_gain or without.rms < criteria.material_ratio * fit.rms:
            return without
    return fit


def _best_form(test: SpecimenTest, terms: Sequence[Term], number: int, name: str, criteria: Criteria) -> _Fit | None:
    """The terms with the effect of this ``name`` at the place ``number``, in the form that explains most: the best of
    its starts in each law, then freer as long as that gains what is significant. None where another law that follows
    the stress at once explains nearly as much: a dead zone is no creep (two of `final310`)."""
    others = [*terms[:number], *terms[number + 1 :]]

    def fitted(start: Term) -> _Fit:
        return _fitted(test, [*terms[:number], start, *terms[number + 1 :]])

    begun: dict[bool, _Fit] = {}
    for fit in sorted(map(fitted, (s for s in specimen_starts() if s[0].name == name)), key=lambda fit: fit.rms):
        begun.setdefault(bool(getattr(fit.terms[number][0], "multiplies", False)), fit)
    found = min((_freed(fit, number, fitted, criteria) for fit in begun.values()), key=lambda fit: fit.rms)
    effect, free = found.terms[number]
    static = effect.at_once(free)
    if static is None:
        return found
    lag = _gain(fitted((cast(PiezoEffect, static.effect), static.free)).residual, found.residual)
    whole = _gain(_fitted(test, others).residual, found.residual)
    return found if lag > max(criteria.significant_gain, criteria.form_share * whole) else None


def _freed(fit: _Fit, number: int, fitted: Callable[[Term], _Fit], criteria: Criteria) -> _Fit:
    """The fit with its term of this ``number`` in freer forms, as long as these gain what is significant."""
    asked = _freer(*fit.terms[number])
    while asked:
        freed = fitted(asked.pop(0))
        if _gain(fit.residual, freed.residual) > criteria.significant_gain and not _at_least(*freed.terms[number]):
            fit = freed
            asked += _freer(*fit.terms[number])
    return fit


def _at_least(effect: PiezoEffect, free: Sequence[str]) -> bool:
    """Whether a number of an effect's form, a time constant say, has come to the least it may be: then the form follows
    what is less than the form, as ages of 0.05 s what presses felt differently leave."""
    known = [(effect.value(key), effect.known(key)) for key in free]
    shape = [(value, one) for value, one in known if not one.defining and one.low != one.neutral]
    return any(value <= one.low + NEAR * one.typical for value, one in shape)


def _freer(effect: PiezoEffect, free: tuple[str, ...]) -> list[Term]:
    return [(cast(PiezoEffect, form.effect), form.free) for form in effect.freer(free)]


def _independent(residual: Array) -> float:
    """Share of the readings (N,) that count as independent: what is left beyond their noise goes on from one to the
    next."""
    return min(1.0, (noise_on_course(residual) / max(_rms(residual), 1e-12)) ** 2)


def _gain(before: Array, after: Array) -> float:
    """Half the change of -2 log likelihood for noise of unknown size, of residuals (N,)."""
    return float(len(before) * np.log(_rms(before) / max(_rms(after), 1e-12)))


def _fitted(test: SpecimenTest, starts: Sequence[Term]) -> _Fit:
    """The terms at their best values, all fitted together."""
    keys = [(number, key) for number, (_, free) in enumerate(starts) for key in free]
    known = [starts[number][0].known(key) for number, key in keys]
    low, high, typical = (np.array([getattr(k, name) for k in known]) for name in ("low", "high", "typical"))

    def at(x: Array) -> list[PiezoEffect]:
        values = iter(map(float, x))
        return [effect.changed({key: next(values) for key in free}) for effect, free in starts]

    def slopes(x: Array) -> Array:
        effects = at(x)
        return np.stack([slope(test, effects, number, key) for number, key in keys], axis=1)

    if not keys:
        left = test.residual(at(np.zeros(0)))
        return _Fit(list(starts), left, np.zeros((len(left), 0)))
    begin = [starts[number][0].value(key) for number, key in keys]
    fit = least_squares(lambda x: test.residual(at(x)), begin, jac=slopes, bounds=(low, high), x_scale=typical)
    terms = [(effect, free) for effect, (_, free) in zip(at(fit.x), starts, strict=True)]
    return _Fit(terms, np.asarray(fit.fun), np.asarray(fit.jac) * typical)


def slope(test: SpecimenTest, effects: Sequence[PiezoEffect], number: int, key: str) -> Array:
    """(n,) derivative of the residual by one parameter, the law fitted anew."""
    known, value = effects[number].parameters()[key], float(getattr(effects[number], key))
    step = STEP * known.typical
    low, high = max(value - step, known.low), min(value + step, known.high)

    def moved(v: float) -> Array:
        return test.residual([e.changed({key: v}) if k == number else e for k, e in enumerate(effects)])

    return np.asarray((moved(high) - moved(low)) / (high - low))


def _rms(residual: Array) -> float:
    return float(np.sqrt((residual**2).mean()))
