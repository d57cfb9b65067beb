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
DIGITS = 9
"""Decimals of a number that count: nearer to an end of its range it is there."""
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
    """An effect, the parameters fitted, what else was fitted in its stead, and the parameters' standard errors."""

    effect: PiezoEffect
    free: tuple[str, ...]
    rivals: tuple[Rival, ...]
    error: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class _Fit:
    """Terms at their best values, fitted together: the ``residual`` (N,) and its derivatives (N,n) by what is free."""

    terms: list[Term]
    residual: Array
    slope: Array

    @property
    def rms(self) -> float:
        return _rms(self.residual)

    def errors(self, noise: float) -> list[tuple[float, ...]]:
        """Standard errors of each term's numbers, for ``noise`` of a reading."""
        error = iter(noise * np.sqrt(np.diag(np.linalg.pinv(self.slope.T @ self.slope))))
        return [tuple(float(next(error)) for _ in free) for _, free in self.terms]


def specimen_findings(test: SpecimenTest, criteria: Criteria) -> tuple[list[SpecimenFinding], float]:
    """Effects that the specimen's loop shows, the strongest first, and the relative noise that they leave.

    An effect enters, in the form that explains most, when its gain is significant, no less than a form's share of the
    largest gain before it, and material. What the first one's form may have left the readings may still name. A form
    that is fitted at an end of a number's range is none: creep at once is another static law (two dead zones of
    `final310` were called that).
    """
    names = list(dict.fromkeys(effect.name for effect, _ in specimen_starts()))
    rivals: list[tuple[Rival, ...]] = []
    best, largest = _Fit([], test.residual(()), np.zeros((len(test.stress_pa), 0))), 0.0
    while len(best.terms) < len(names):
        taken = {effect.name for effect, _ in best.terms}
        tried = [_best_form(test, best.terms, len(taken), name, criteria) for name in names if name not in taken]
        fits = sorted((fit for fit in tried if fit is not None), key=lambda fit: fit.rms)
        gains = [_gain(best.residual, fit.residual) for fit in fits]
        least = max(criteria.significant_gain, criteria.second_share * largest)
        if not fits or gains[0] < least or best.rms < criteria.material_ratio * fits[0].rms:
            break
        largest, best = max(largest, gains[0]), _reformed(test, fits[0], criteria)
        others = zip(fits[1:], gains[1:], strict=True)
        rivals.append(tuple(Rival(fit.terms[-1][0], gains[0] - gain) for fit, gain in others))
    freedom = len(best.residual) - ORDER - 1 - best.slope.shape[1]
    noise = float(np.sqrt((best.residual**2).sum() / max(freedom, 1)))
    errors = best.errors(noise)
    found = zip(best.terms, rivals, errors, strict=True)
    return [SpecimenFinding(*term, others, error) for term, others, error in found], noise


def _reformed(test: SpecimenTest, fit: _Fit, criteria: Criteria) -> _Fit:
    """The same effects in their other forms too: one chosen while another effect was missing did its part."""
    for number, (effect, _) in enumerate(fit.terms[:-1]):
        other = _best_form(test, fit.terms, number, effect.name, criteria)
        if other is not None and other.rms < fit.rms:
            fit = other
    return fit


def _best_form(test: SpecimenTest, terms: Sequence[Term], number: int, name: str, criteria: Criteria) -> _Fit | None:
    """The terms with the effect of this ``name`` at the place ``number``, in the form that explains most: the best of
    its starts, then freer as long as that gains what is significant. None where it takes no form."""

    def fitted(start: Term) -> _Fit:
        return _fitted(test, [*terms[:number], start, *terms[number + 1 :]])

    begun = [fitted(start) for start in specimen_starts() if start[0].name == name]
    found = min((fit for fit in begun if _is_a_form(*fit.terms[number])), key=lambda fit: fit.rms, default=None)
    if found is None:
        return None
    asked = _freer(*found.terms[number])
    while asked:
        freed = fitted(asked.pop(0))
        if _gain(found.residual, freed.residual) > criteria.significant_gain and _is_a_form(*freed.terms[number]):
            found = freed
            asked += _freer(*found.terms[number])
    return found


def _freer(effect: PiezoEffect, free: tuple[str, ...]) -> list[Term]:
    return [(cast(PiezoEffect, form.effect), form.free) for form in effect.freer(free)]


def _is_a_form(effect: PiezoEffect, free: Sequence[str]) -> bool:
    """Whether no number has come to an end of its range, but for its neutral value."""
    known = [effect.parameters()[key] for key in free]
    values = [round(float(getattr(effect, key)), DIGITS) for key in free]
    return all(v == k.neutral or k.low < v < k.high for v, k in zip(values, known, strict=True))


def _gain(before: Array, after: Array) -> float:
    """Half the change of -2 log likelihood for noise of unknown size, of residuals (N,)."""
    return float(len(before) * np.log(_rms(before) / max(_rms(after), 1e-12)))


def _fitted(test: SpecimenTest, starts: Sequence[Term]) -> _Fit:
    """The terms at their best values, all fitted together."""
    known = [effect.parameters()[key] for effect, free in starts for key in free]

    def at(x: Array) -> list[PiezoEffect]:
        values = iter(map(float, x))
        return [effect.changed({key: next(values) for key in free}) for effect, free in starts]

    fit = least_squares(
        lambda x: test.residual(at(x)),
        [getattr(effect, key) for effect, free in starts for key in free],
        bounds=([k.low for k in known], [k.high for k in known]),
        x_scale=[k.typical for k in known],
        diff_step=1e-3,
    )
    terms = [(effect, free) for effect, (_, free) in zip(at(fit.x), starts, strict=True)]
    return _Fit(terms, np.asarray(fit.fun), np.asarray(fit.jac))


def _rms(residual: Array) -> float:
    return float(np.sqrt((residual**2).mean()))
