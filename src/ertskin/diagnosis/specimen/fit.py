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
    """An effect, the parameters fitted, and what else was fitted in its stead."""

    effect: PiezoEffect
    free: tuple[str, ...]
    rivals: tuple[Rival, ...]


def specimen_findings(test: SpecimenTest, criteria: Criteria) -> tuple[list[SpecimenFinding], float]:
    """Effects that the specimen's loop shows, the strongest first, and the relative noise that they leave.

    An effect enters when its gain is significant, no less than a form's share of the largest gain before it, and
    material. What the first one's form may have left the readings may still name.
    """
    starts = specimen_starts()
    terms: list[Term] = []
    rivals: list[tuple[Rival, ...]] = []
    residual, largest = test.residual(()), 0.0
    while len(terms) < len({effect.name for effect, _ in starts}):
        taken = {effect.name for effect, _ in terms}
        fits = [_fitted(test, [*terms, start]) for start in starts if start[0].name not in taken]
        # Half the change of -2 log likelihood for noise of unknown size.
        gains = [float(len(residual) * np.log(_rms(residual) / max(_rms(left), 1e-12))) for _, left in fits]
        best = int(np.argmax(gains))
        least = max(criteria.significant_gain, criteria.second_share * largest)
        if gains[best] < least or _rms(residual) < criteria.material_ratio * _rms(fits[best][1]):
            break
        largest = max(largest, gains[best])
        terms, residual = _reformed(test, *fits[best])
        others = [Rival(fit[0][-1][0], gains[best] - gain) for fit, gain in zip(fits, gains, strict=True)]
        rivals.append(tuple(rival for rival in others if rival.effect.name != terms[-1][0].name))
    freedom = len(residual) - ORDER - 1 - sum(len(free) for _, free in terms)
    found = [SpecimenFinding(*term, others) for term, others in zip(terms, rivals, strict=True)]
    return found, float(np.sqrt((residual**2).sum() / max(freedom, 1)))


def _reformed(test: SpecimenTest, terms: list[Term], residual: Array) -> tuple[list[Term], Array]:
    """The same effects from their other starts too: a form chosen while another effect was missing did its part."""
    for number, term in enumerate(terms):
        for start in specimen_starts():
            if start[0].name == term[0].name:
                fitted, left = _fitted(test, [*terms[:number], start, *terms[number + 1 :]])
                if _rms(left) < _rms(residual):
                    terms, residual = fitted, left
    return terms, residual


def _fitted(test: SpecimenTest, starts: Sequence[Term]) -> tuple[list[Term], Array]:
    """The terms at their best values, all fitted together, and the residual (N,)."""
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
    return [(effect, free) for effect, (_, free) in zip(at(fit.x), starts, strict=True)], np.asarray(fit.fun)


def _rms(residual: Array) -> float:
    return float(np.sqrt((residual**2).mean()))
