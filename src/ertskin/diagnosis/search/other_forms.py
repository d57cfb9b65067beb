"""What may be better beside what follows than what entered: other forms of it, another effect in a field's stead.

Alone a form may fit best because it takes up part of what is still missing. Contacts under pads pressed alike left 1.82
of the noise, contacts pressed unevenly 1.91: with an indenter that lands 0.3 mm off, which was missing, these left
0.98, and beside those it wasn't even tried (c023 of `twentyfourth48`). A smooth field takes up of everything else what
it can, and what else there is then seems to gain next to nothing: a sheet's field left 1.08 alone and with contacts
under pressure, these alone 2.62 and with a field begun beside them 1.01 (c025 of `thirtyfirst48`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ertskin.diagnosis.fit.full_solution_check import CheckedFit
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.candidates import screen
from ertskin.diagnosis.search.chosen import Rivals
from ertskin.diagnosis.search.entering import AS_GOOD, promises, short_of
from ertskin.diagnosis.search.exchange import gain_of_exchange
from ertskin.diagnosis.search.forms import law_of
from ertskin.diagnosis.search.trials import Trial

BEFORE_FIELD = 0.3
"""Part of what a smooth field gains that another effect must gain alone to be gone on with in its stead."""


@dataclass(frozen=True, eq=False)
class OtherForm:
    """A trial of what entered in another form, or of what may come before the smooth ``field`` that did; the
    ``rivals`` of its effect, and how many terms were fixed then."""

    trial: Trial
    rivals: Rivals
    fixed: int
    field: Term | None = None

    def may_replace(self, terms: Sequence[Term], fixed: int) -> bool:
        """Whether its effect is among the terms, in another form, or isn't and the field is, and as many are ``fixed``
        as were then."""
        alike = [law_of(term) for term in terms if term.name == self.trial.term.name]
        if self.field is None:
            new = bool(alike) and law_of(self.trial.term) not in alike
        else:
            new = not alike and any(term.name == self.field.name and term.modes is not None for term in terms)
        return self.fixed == fixed and new


def other_forms(entered: Trial, trials: Sequence[Trial], rivals: Rivals, fixed: int) -> list[OtherForm]:
    """The best trial in every other form of few numbers of what entered that gains nearly as much as it; of a smooth
    field the best of an effect that is no field and not there yet, where it gains enough."""
    if entered.term.modes is not None:
        present = {term.name for term in entered.solved.terms}
        new = [one for one in trials if one.term.name not in present and not one.term.effect.hypothesis.field]
        best = max(new, key=lambda one: one.gain, default=None)
        enough = best is not None and best.gain >= BEFORE_FIELD * entered.gain
        return [OtherForm(best, short_of(best, trials), fixed, entered.term)] if best is not None and enough else []
    found = {law_of(entered.term): entered}
    for trial in trials:
        alike = trial.term.name == entered.term.name and trial.term.modes is None
        if alike and trial.gain >= AS_GOOD * entered.gain:
            found.setdefault(law_of(trial.term), trial)
    return [OtherForm(trial, rivals, fixed) for trial in list(found.values())[1:]]


def may_be_likelier(
    fit: CheckedFit, incumbent: CheckedFit, form: OtherForm, least: float, partitions: Sequence[Sequence[int]]
) -> bool:
    """Whether a fit with another ``form`` is expected to be likelier than the incumbent by more than the ``least`` with
    the likeliest candidate more; before a field, whether it is likelier at all with a field of that kind beside it."""
    if form.field is not None:
        return promises(incumbent, fit, form.field, partitions)
    found = screen(fit.problem, fit.problem.at_hand(fit.solved), partitions)
    expected = max([0.0, *(candidate.gain for candidate in found)])
    return gain_of_exchange(incumbent, fit) + expected > least
