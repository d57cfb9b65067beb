"""Which effects the load cell shows: sets compared by how well presses held out are predicted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.force.fit import ForceData, ForceFit, fit_force, force_starts
from ertskin.diagnosis.force.remainder import likeliest
from ertskin.physics.effects.effect import Start

ROUNDS = 8
"""Most changes of a set: each makes it likelier, so this only bounds the time."""


@dataclass(frozen=True, eq=False)
class ForceSearch:
    """Forces with the ``folds`` (T,) of frames they are predicted by, and what a name must gain in half chi-square."""

    data: ForceData
    folds: NDArray[np.intp]
    threshold: float
    second_share: float

    def predicted_misfit(self, fit: ForceFit) -> float:
        """Misfit of every fold predicted by a fit to the others, as ``ForceFit.misfit`` counts it."""
        total, used = -self.data.by_readings(fit.terms), self.data.used
        for fold in np.unique(self.folds):
            outside = self.folds != fold
            wrong = fit_force(self.data, fit.terms, outside, fit).residual[~outside][used[~outside]]
            if fit.remainder is not None:
                wrong = fit.remainder.rows((~outside[:, None] & used)[used]).whitened(wrong)
            total += 0.5 * float(np.minimum(wrong**2, 1e6).sum())
        return total

    def best_form(self, others: Sequence[Start], name: str, start: ForceFit) -> ForceFit:
        """The fit of ``others`` with that form of the named effect that Schwarz's criterion prefers."""
        fits = [fit_force(self.data, [*others, one], start=start) for one in force_starts()[name]]
        return min(fits, key=lambda fit: fit.information)


def select_force_effects(
    data: ForceData, folds: NDArray[np.intp], threshold: float, second_share: float, begun: Sequence[Start] = ()
) -> tuple[ForceFit, ForceFit]:
    """The fits without and with the effects chosen, by held-out likelihood over the folds (T,) of frames.

    An effect enters, takes another's place and stays while that gains ``threshold`` in half chi-square held out; what
    is lost without it must also exceed ``second_share`` of what the most important one is worth: less may be owed to
    that one's form. What no effect explains competes with every effect and, once it explains more, is part of the
    noise. The search begins with the effects ``begun``.
    """
    search, history, used = ForceSearch(data, folds, threshold, second_share), data.history, data.used
    base = fit_force(data, ())
    best = fit_force(data, begun) if begun else base
    score = search.predicted_misfit(best)
    for _ in range(ROUNDS):
        changed, gain = _most(search, best, score)
        remainder, evidence = likeliest(history, used, history.force_n[used], best.residual[used])
        if best.remainder is None and evidence > max(gain, threshold):
            best = fit_force(data, best.terms, start=replace(best, remainder=remainder))
            score = search.predicted_misfit(best)
            continue
        if gain < threshold:
            break
        best, score = changed, score - gain
    return base, _without_the_small(search, best, score)


def _most(search: ForceSearch, best: ForceFit, score: float) -> tuple[ForceFit, float]:
    """The likeliest set that has one effect more, or another, or another form, in one's place, and what it gains held
    out."""
    found = [(best, 0.0)]
    for name in force_starts():
        for rest in (best.terms, *_each_without(best)):
            if name in [term.effect.name for term in rest]:
                continue
            fit = search.best_form(rest, name, best)
            # What fits no better predicts no better.
            if best.misfit - fit.misfit > search.threshold:
                found.append((fit, score - search.predicted_misfit(fit)))
    return max(found, key=lambda pair: pair[1])


def _each_without(fit: ForceFit) -> list[tuple[Start, ...]]:
    return [tuple(other for other in fit.terms if other is not term) for term in fit.terms]


def _without_the_small(search: ForceSearch, best: ForceFit, score: float) -> ForceFit:
    """The fit without effects that are worth less than is asked, alone and as a share of what the largest is worth to
    the load cell."""
    while best.terms:
        fits = [fit_force(search.data, rest, start=best) for rest in _each_without(best)]
        losses = [search.predicted_misfit(fit) - score for fit in fits]
        of_force = [loss - search.data.by_readings([term]) for loss, term in zip(losses, best.terms, strict=True)]
        k = int(np.argmin(losses))
        if not losses[k] < max(search.threshold, search.second_share * max(of_force)):
            break
        best, score = fits[k], score + losses[k]
    return best
