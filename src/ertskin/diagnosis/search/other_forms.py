"""Forms of an effect that explained nearly as much as the one that entered, and may be better beside what follows.

Alone a form may fit best because it takes up part of what is still missing. Contacts under pads pressed alike left 1.82
of the noise, contacts pressed unevenly 1.91: with an indenter that lands 0.3 mm off, which was missing, these left
0.98, and beside those it wasn't even tried (c023 of `twentyfourth48`).
"""

from __future__ import annotations

from collections.abc import Sequence

from ertskin.diagnosis.fit.full_solution_check import CheckedFit, Problem
from ertskin.diagnosis.search.candidates import screen
from ertskin.diagnosis.search.entering import AS_GOOD
from ertskin.diagnosis.search.forms import form_of
from ertskin.diagnosis.search.settling import where_it_settles
from ertskin.diagnosis.search.trials import Trial, unlikely


def other_forms(entered: Trial, trials: Sequence[Trial]) -> list[Trial]:
    """The trials of the name that entered in another form of few numbers that gains nearly as much, the best first."""

    def is_other(trial: Trial) -> bool:
        same = trial.term.name == entered.term.name and trial.term.modes is None
        return same and form_of(trial.term) != form_of(entered.term) and trial.gain >= AS_GOOD * entered.gain

    return [] if entered.term.modes is not None else [trial for trial in trials if is_other(trial)]


def begun_anew(
    build: Problem, incumbent: CheckedFit, form: Trial, fixed: int, partitions: Sequence[Sequence[int]]
) -> CheckedFit | None:
    """The fit with a form and what came before it, where it settles; None where its first ``fixed`` terms are others by
    now, or where no candidate is expected to make it likelier than the incumbent."""
    if [t.name for t in form.solved.terms[:fixed]] != [t.name for t in incumbent.solved.terms[:fixed]]:
        return None
    fit = where_it_settles(build, None, form.solved)
    if fit is None:
        return None
    found = screen(fit.problem, fit.problem.at_hand(fit.solved), partitions)
    expected = max((candidate.gain for candidate in found), default=0.0)
    least = incumbent.problem.evidence.criteria.significant_gain
    return fit if unlikely(fit.solved) - expected < unlikely(incumbent.solved) - least else None
