"""Which of the trials enters: the first that holds where it settles, in the form that predicts best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ertskin.diagnosis.contract.claims import Rival
from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.fit.cross_validation import log_misfit_held_out
from ertskin.diagnosis.fit.full_solution_check import CheckedFit, Problem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.candidates import Candidate
from ertskin.diagnosis.search.chosen import Rivals
from ertskin.diagnosis.search.exchange import counting_leftover, gain_of_exchange
from ertskin.diagnosis.search.settling import refined, where_it_settles
from ertskin.diagnosis.search.smooth_fields import with_smooth_field
from ertskin.diagnosis.search.trials import KNOWN, Trial, is_worth_a_name, unlikely
from ertskin.physics.effects.effect import shown_by
from ertskin.physics.effects.hypothesis import Signal

ALIKE = 0.5
"""Part of the best form's gain from which another form of the same effect is settled too."""
FORMS = 2
"""How many forms of one effect are settled."""
AS_GOOD = 0.9
"""Part of what the form that fits best explains, from which on another one may be the better by what it predicts."""


def likely(trials: Sequence[Trial], criteria: Criteria) -> list[Trial]:
    """Those that gain at least half of what the best one gains: of less likely ones none takes a field's place."""
    least = criteria.most_share * max((trial.gain for trial in trials), default=0.0)
    return [trial for trial in trials if trial.gain >= least]


def short_of(trial: Trial | Candidate, trials: Sequence[Trial] | Sequence[Candidate]) -> Rivals:
    """The trials, or candidates, of other names, by how much each falls short of this one."""
    others = [t for t in trials if t.term.name != trial.term.name and t.gain <= (1 + KNOWN) * trial.gain]
    return tuple(Rival(t.term.effect, trial.gain - t.gain) for t in others)


def first_to_hold(
    build: Problem, incumbent: CheckedFit, trials: Sequence[Trial], partitions: Sequence[Sequence[int]]
) -> tuple[Trial, CheckedFit] | None:
    """The first trial that, settled, fits frames solved in full no worse than the incumbent, and where it settles.

    Of forms of one name that gain about as much the best where they settle, with the first one's gain: what a fit in
    the skin linearised elsewhere gains doesn't tell between them. Of smooth fields of two properties that do the one
    with which cells held out are predicted better, significantly, by whole fits.
    """
    left = list(trials)
    while left:
        first = left[0]
        alike = [t for t in left if t.term.name == first.term.name and t.gain > ALIKE * first.gain]
        left = [t for t in left if t not in alike]
        forms = alike if len(alike) <= FORMS else sorted(alike, key=lambda t: unlikely(t.solved))[:FORMS]
        places = [(form, _where_it_holds(build, incumbent, form, partitions)) for form in forms]
        held = [(form, fit) for form, fit in places if fit is not None]
        if held:
            form, fit = _best_form(incumbent, held, partitions)
            others = [trial for trial in left if _of_another_property(form, trial, first.gain)]
            other = others[0] if others and not incumbent.problem.evidence.work.ends() else None
            other_fit = None if other is None else _where_it_holds(build, incumbent, other, partitions)
            if other is not None and other_fit is not None:
                likelier = _predicting(fit, partitions) - _predicting(other_fit, partitions)
                if likelier > incumbent.problem.evidence.criteria.significant_gain:
                    return replace(other, gain=first.gain + likelier), other_fit
            return replace(form, gain=first.gain), fit
    return None


def _of_another_property(field: Trial, trial: Trial, gain: float) -> bool:
    """Whether a field that gains so much and a trial are smooth fields of two properties that gain nearly alike.

    Modes enough follow the presses at hand whichever property varies: hills of sensitivity as a sheet that varies
    fitted them to 1.03 of the noise and missed others by 1.35, as themselves by 1.08 and 1.10 (c029 of
    `twentyfourth48`).
    """
    smooth = field.term.modes is not None and trial.term.modes is not None
    return smooth and trial.term.name != field.term.name and trial.gain >= AS_GOOD * gain


def _where_it_holds(
    build: Problem, incumbent: CheckedFit, trial: Trial, partitions: Sequence[Sequence[int]]
) -> CheckedFit | None:
    """The trial where it settles, with its form freed if need be; None where frames fit worse than the incumbent's.

    What no network explains pulls at the frames, too, where an instrument's form is wrong: crosstalk that gained 6 000
    in half chi-square fitted them worse by 2.6 % than without, with its forms freed better by 23 % (c055 of
    `nineteenth96`).
    """
    fit = where_it_settles(build, None, trial.solved)
    if fit is not None and fit.spoils(incumbent) and shown_by(trial.term.effect, Signal.NONRECIPROCAL):
        fit = refined(build, fit, partitions)
    return None if fit is None or fit.spoils(incumbent) else fit


def _best_form(
    incumbent: CheckedFit, forms: Sequence[tuple[Trial, CheckedFit]], partitions: Sequence[Sequence[int]]
) -> tuple[Trial, CheckedFit]:
    """The form that fits best; with a field among those that explain nearly as much, the one that predicts cells best,
    or where no more is to be computed that of the fewest numbers.

    A freer field fits the presses at hand better and runs on between them: on twelve presses of `rig_a` one of 65
    numbers fitted to 1.06 of the noise and missed presses elsewhere by 3.28, one of ten to 1.08 and 1.14.
    """
    least = min(fit.misfit for _, fit in forms)
    most = incumbent.misfit**2 - least**2
    explained = min(AS_GOOD * most, most / AS_GOOD)
    as_good = [pair for pair in forms if incumbent.misfit**2 - pair[1].misfit ** 2 >= explained]
    if len(as_good) == 1 or all(form.term.modes is None for form, _ in as_good):
        return min(forms, key=lambda pair: pair[1].misfit)
    if incumbent.problem.evidence.work.ends():
        return min(as_good, key=lambda pair: len(pair[1].solved.fit.value))
    return min(as_good, key=lambda pair: _predicting(pair[1], partitions))


def _predicting(fit: CheckedFit, partitions: Sequence[Sequence[int]]) -> float:
    return log_misfit_held_out(fit.problem, fit.solved, partitions)


def of_few_numbers(
    build: Problem,
    incumbent: CheckedFit,
    entered: tuple[Trial, CheckedFit],
    trials: Sequence[Trial],
    partitions: Sequence[Sequence[int]],
) -> tuple[Trial, CheckedFit]:
    """A trial of few numbers in place of the field that ``entered``, where it gains most of that, and of the two
    together is the one that is missed more, and significantly; in a spot's or a line's place where it settles better.

    Any sharp cause looks like a field that is sharp there: a pad out of place like a hill under it.
    """
    field, field_fit = entered
    if not field.term.effect.hypothesis.field:
        return entered
    least = incumbent.problem.evidence.criteria.most_share * field.gain
    smooth = field.term.modes is not None

    def likelier_than(field_fit: CheckedFit, simpler: CheckedFit) -> float | None:
        if smooth:
            return _likelier_than_field(simpler, field_fit, field.term, partitions)
        return _likelier(simpler.solved, field_fit)

    for trial in trials:
        varies = trial.term.effect.hypothesis.field
        if trial.term.modes is not None or trial.term.name == field.term.name or (varies and not smooth):
            continue
        if trial.gain < least or not is_worth_a_name(incumbent.problem, incumbent.solved, trial.term, field.gain):
            continue
        simpler = where_it_settles(build, None, trial.solved)
        if simpler is None or simpler.spoils(incumbent):
            continue
        likelier = likelier_than(field_fit, simpler)
        if likelier is None and not varies:
            # A field takes up whatever a form that isn't freed leaves.
            simpler, field_fit = refined(build, simpler, partitions), refined(build, field_fit, partitions)
            likelier = likelier_than(field_fit, simpler)
        if likelier is not None:
            return replace(trial, gain=field.gain + likelier), simpler
    return field, field_fit


def _likelier(solved: Solved, other: CheckedFit, least: float = 0.0) -> float | None:
    """By how much a fit is likelier than another of its frames; None where not significantly, or by ``least`` at
    most."""
    counted = counting_leftover(other.problem, other.solved, solved.leftover)
    likelier = unlikely(counted) - unlikely(solved)
    return likelier if likelier > max(other.problem.evidence.criteria.significant_gain, least) else None


def _likelier_than_field(
    simpler: CheckedFit, field_fit: CheckedFit, field: Term, partitions: Sequence[Sequence[int]]
) -> float | None:
    """By how much both together are likelier than the field alone; None where the field is the one missed more, or
    neither significantly."""
    problem, solved = simpler.problem, simpler.solved
    begun = problem.solve([*solved.terms, Term(type(field.effect)(), ())], solved.calibration, steps=0)
    both = with_smooth_field(problem, begun, len(solved.terms), partitions) or solved
    return _likelier(both, field_fit, unlikely(begun) - unlikely(both))


def promises(incumbent: CheckedFit, proposed: CheckedFit, field: Term, partitions: Sequence[Sequence[int]]) -> bool:
    """Whether a proposed fit is likelier than the incumbent, as it is or with a smooth field of this kind beside it.

    What would follow takes several times as long to find: a search more on 36 presses. How much likelier is asked of
    what it comes to: a fit whose field isn't settled yet doesn't tell.
    """
    problem, solved = proposed.problem, proposed.solved
    begun = problem.solve([*solved.terms, Term(type(field.effect)(), ())], solved.calibration, steps=0)
    both = with_smooth_field(problem, begun, len(solved.terms), partitions)
    fits = [proposed] if both is None else [proposed, replace(proposed, solved=both)]
    return any(gain_of_exchange(incumbent, fit) > 0 for fit in fits)
