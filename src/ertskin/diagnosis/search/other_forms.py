"""Forms of an effect that explained nearly as much as the one that entered, and may be better beside what follows.

Alone a form may fit best because it takes up part of what is still missing. Contacts under pads pressed alike left 1.82
of the noise, contacts pressed unevenly 1.91: with an indenter that lands 0.3 mm off, which was missing, these left
0.98, and beside those it wasn't even tried (c023 of `twentyfourth48`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ertskin.diagnosis.fit.full_solution_check import CheckedFit
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.candidates import screen
from ertskin.diagnosis.search.chosen import Rivals
from ertskin.diagnosis.search.entering import AS_GOOD
from ertskin.diagnosis.search.exchange import gain_of_exchange
from ertskin.diagnosis.search.forms import law_of
from ertskin.diagnosis.search.trials import Trial


@dataclass(frozen=True, eq=False)
class OtherForm:
    """A trial of what entered in another form, the ``rivals`` of that effect, and how many terms were fixed then."""

    trial: Trial
    rivals: Rivals
    fixed: int

    def may_replace(self, terms: Sequence[Term], fixed: int) -> bool:
        """Whether its effect is among the terms, in another form, and as many are ``fixed`` as were then."""
        alike = [law_of(term) for term in terms if term.name == self.trial.term.name]
        return self.fixed == fixed and bool(alike) and law_of(self.trial.term) not in alike


def other_forms(entered: Trial, trials: Sequence[Trial], rivals: Rivals, fixed: int) -> list[OtherForm]:
    """The best trial in every other form of few numbers of what entered that gains nearly as much as it."""
    found = {law_of(entered.term): entered}
    for trial in trials if entered.term.modes is None else ():
        alike = trial.term.name == entered.term.name and trial.term.modes is None
        if alike and trial.gain >= AS_GOOD * entered.gain:
            found.setdefault(law_of(trial.term), trial)
    return [OtherForm(trial, rivals, fixed) for trial in list(found.values())[1:]]


def may_be_likelier(fit: CheckedFit, incumbent: CheckedFit, least: float, partitions: Sequence[Sequence[int]]) -> bool:
    """Whether a fit with the likeliest candidate more is expected to be likelier than the incumbent by more than the
    ``least``."""
    found = screen(fit.problem, fit.problem.at_hand(fit.solved), partitions)
    expected = max([0.0, *(candidate.gain for candidate in found)])
    return gain_of_exchange(incumbent, fit) + expected > least
