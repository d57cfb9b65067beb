"""Candidates fitted beside the terms at hand: which are worth a fit, how a fit begins, what each gains."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ertskin.diagnosis.fit.full_solution_check import CheckedFit
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.candidates import Candidate
from ertskin.diagnosis.search.form_error import form_error
from ertskin.diagnosis.search.forms import form_of
from ertskin.diagnosis.search.gain import freedom, gained
from ertskin.diagnosis.search.smooth_fields import with_smooth_field
from ertskin.physics.effects.effect import Effect, shown_by
from ertskin.physics.effects.hypothesis import Axis, Need, Signal

KNOWN = 0.05
"""Share within which a term of a name that is in the fit already gains as much as one of another name."""
TRIED = 3
WORTH_TRYING = 0.15
"""Least part of the best candidate's expected gain that makes another worth a fit."""
EXPECTED = 0.2
"""Part of what a name must gain that a candidate must be expected to gain: of 230 fits on recordings of known truth
none of those known to be expected to gain less gained a third of it (of two what was expected wasn't kept)."""
FIRST_SHARE = 1 / 6
"""Part of what is material that is enough for a first name where the misfit is no mismatch."""
COLOURED = 3.0
"""Times what is significant under white noise that it is under any: coloured noise made 33 and 34 in half chi-square of
a gain that there wasn't."""
SHARES = 1.0, 0.3, 0.1
"""Of a candidate's size, at which it is begun."""


FULFILLED = 0.5
"""Part of what the first candidate of few numbers is expected to gain that its fit must, or it is fitted again where it
settles."""

Settle = Callable[[Solved], CheckedFit | None]


@dataclass(frozen=True, eq=False)
class Trial:
    """A candidate fitted beside the terms at hand, and the half chi-square that it gains held out."""

    term: Term
    gain: float
    solved: Solved


def trials_of(
    problem: VoltageProblem,
    current: Solved,
    found: Sequence[Candidate],
    partitions: Sequence[Sequence[int]],
    left: float,
    settle: Settle = lambda solved: None,
) -> Iterator[list[Trial]]:
    """The likeliest candidates of those ``found``, fitted, list by list, each for where nothing of those before enters,
    best first: the instrument, others, more of the instrument's names at hand.

    A further name gains what it gains beyond the form error of the terms at hand, which itself would gain ``left``.
    ``settle`` linearises about a fit that has gone far: the first candidate of few numbers, where it doesn't gain what
    was expected of it, is judged there.
    """
    least = worth_a_name(problem, current)
    present = {term.name for term in current.terms}
    for listed in _worth_trying(problem, found, present, least):
        yield _in_order(_try(problem, current, _different(listed), partitions, left, settle), current)


def worth_a_name(problem: VoltageProblem, current: Solved) -> float:
    """Half chi-square, held out, that a term must gain beside the others: what is significant and material."""
    return _worth(problem, current, first=not current.terms)


def worthy(problem: VoltageProblem, current: Solved, trials: Sequence[Trial], asked: Sequence[Trial]) -> list[Trial]:
    """Those of the trials ``asked`` so far that are worth a name; none that gains less than one asked that isn't, which
    would stay unsaid."""
    worth = [trial for trial in asked if is_worth_a_name(problem, current, trial.term, trial.gain)]
    unsaid = max((trial.gain for trial in asked if trial not in worth), default=0.0)
    at_rest = problem.evidence.seen_at_rest
    return [t for t in trials if t in worth and (t.gain >= unsaid or t.term.name == at_rest)]


def instrument_worth_a_name(problem: VoltageProblem, current: Solved, asked: Sequence[Trial]) -> Trial | None:
    """The likeliest of the trials ``asked`` so far that is of the instrument, worth a name and of a new one."""
    known = {term.name for term in current.terms}
    new = [t for t in asked if _of_instrument(t.term) and t.term.name not in known]
    worth = [t for t in new if is_worth_a_name(problem, current, t.term, t.gain)]
    return max(worth, key=lambda trial: trial.gain, default=None)


def compatible_with_instrument(
    problem: VoltageProblem, trials: Sequence[Trial], instrument: Trial | None
) -> list[Trial]:
    """The trials without those of other names that gain less than half of what one of the instrument does, unless rest
    frames show them.

    If that one doesn't hold, its form is none that is known, and another name that gains a part as much mends the form.
    Nearly all of its gain is what no network explains, so this keeps all names of the network's from where the
    instrument's form is far off, whatever they explain: common mode was a converter's limit, a field of the sheet and
    more after it, for twelve minutes (c013 of `twentysixth48`; c039 of `third48`).
    """
    if instrument is None:
        return list(trials)
    least = problem.evidence.criteria.most_share * instrument.gain
    may = instrument.term.name, problem.evidence.seen_at_rest
    return [trial for trial in trials if trial.gain >= least or trial.term.name in may]


def is_worth_a_name(problem: VoltageProblem, current: Solved, term: Term, gain: float) -> bool:
    """Whether a term gains what it must. What rest frames show by themselves needn't be material: no error in the form
    of what presses do is there to be mended. A field that presses alone show must always be, for one of a few places
    takes what any other cause does to these, and what may drift, for coloured noise does: a channel that warms
    explained 257 in half chi-square of it (c036 of `twentyfifth48`)."""
    if term.name == problem.evidence.seen_at_rest:
        return gain >= problem.evidence.criteria.significant_gain
    alone = all(other is term for other in current.terms)
    return gain >= _worth(problem, current, first=alone and not (of_presses(term) or may_drift(term)))


def _worth(problem: VoltageProblem, current: Solved, first: bool) -> float:
    """A ``first`` name needn't be quite material where scans of a network are missed by less than a mismatch: no form
    of another can be in error."""
    criteria, numbers, cost = problem.evidence.criteria, residual_count(problem), of_scans(current)
    material = material_cost(numbers, cost, criteria.material_ratio)
    if not first or rms_of(current) > criteria.mismatch_ratio:
        return max(criteria.significant_gain, material)
    part = material_cost(numbers, cost, 1 + FIRST_SHARE * (criteria.material_ratio - 1))
    return max(criteria.significant_gain, min(material, max(COLOURED * criteria.significant_gain, part)))


def of_presses(term: Term) -> bool:
    """Whether it is a field over the sheet that only presses show."""
    return only_presses_show(term.effect)


def only_presses_show(effect: Effect) -> bool:
    """Whether an effect is such a field."""
    return effect.hypothesis.field and Need.PRESSES in effect.hypothesis.needs


def may_drift(term: Term) -> bool:
    """Whether it, or a freer form of it, changes with time as noise may: whatever presses and the scan do."""
    axes = set(term.effect.hypothesis.axes)
    return Axis.TIME in axes and axes <= {Axis.TIME, Axis.ELECTRODE}


def _worth_trying(
    problem: VoltageProblem, found: Sequence[Candidate], present: Collection[str], least: float
) -> list[list[Candidate]]:
    """The candidates to fit, each further list where nothing of those before is worth a name.

    What no resistor network explains only the instrument can: it comes first. An instrument that would gain less than
    ``least`` wouldn't be named, and doesn't keep the others from their turn. More of one whose name is ``present``
    comes last: it is what the form error of that one already holds against every other name. What rest frames show is
    tried wherever it is significant.
    """
    significant, at_rest = problem.evidence.criteria.significant_gain, problem.evidence.seen_at_rest

    def expected(candidate: Candidate, best: Candidate) -> bool:
        bar = max(significant, EXPECTED * least, WORTH_TRYING * best.gain)
        return candidate.gain > (significant if candidate.name == at_rest else bar)

    instrument = [c for c in found if c.beyond > least]
    others = [c for c in found if c.beyond <= least and (c.gain > least or not _of_instrument(c.term))]
    new, more = ([c for c in instrument if (c.name in present) is known] for known in (False, True))
    return [[c for c in alike if expected(c, alike[0])] for alike in (new, others, more) if alike]


def _of_instrument(term: Term) -> bool:
    """Whether what no resistor network explains shows the term."""
    return shown_by(term.effect, Signal.NONRECIPROCAL)


def _in_order(trials: Sequence[Trial], current: Solved) -> list[Trial]:
    """By what they gain; where two gain alike, the one whose name is in the fit already is the likelier."""
    present = {term.name for term in current.terms}
    return sorted(trials, key=lambda t: -t.gain * (1 + KNOWN if t.term.name in present else 1.0))


def _different(listed: Sequence[Candidate]) -> list[Candidate]:
    """The best starts of each name (two, and a smooth field, at most), the best names first."""
    kept: list[Candidate] = []
    for candidate in listed:
        same = [k for k in kept if k.name == candidate.name]
        forms = {form_of(k.term) for k in same}
        if len({k.name for k in kept} | {candidate.name}) > TRIED:
            continue
        smooth = candidate.term.modes is not None
        if not same or (form_of(candidate.term) not in forms and (smooth or len(same) < 2)):
            kept.append(candidate)
    return kept


def _try(
    problem: VoltageProblem,
    current: Solved,
    candidates: Sequence[Candidate],
    partitions: Sequence[Sequence[int]],
    left: float = 0.0,
    settle: Settle = lambda solved: None,
) -> list[Trial]:
    """Each candidate fitted for good, beside a form error of the terms at hand that gains ``left`` without it."""
    results = []
    instrument = any(_of_instrument(c.term) for c in candidates)
    without = problem.solve(current.terms, current.calibration, steps=1, leftover=True) if instrument else current
    known, criteria = {term.name for term in current.terms}, problem.evidence.criteria

    def trial(solved: Solved, made_with: VoltageProblem = problem) -> Trial:
        gain, term = gained(without, solved, partitions, criteria), solved.terms[-1]
        if left > 0 and term.name not in known:
            gain += form_error(made_with, solved, partitions, solved.effects[:-1]).gain - left
        return Trial(term, gain, solved)

    problem.reuse = True
    for candidate in candidates:
        solved = _with_candidate(problem, without, candidate, instrument)
        if candidate.term.effect.hypothesis.must_show_at_rest and not _shown_at_rest(problem, current, solved):
            continue
        results.append(trial(solved))
    problem.reuse = False
    least = worth_a_name(problem, current)
    results += [trial(both) for both in _with_remainders(problem, results, partitions, EXPECTED * least)]
    if results:
        # Cells are predicted by a step from the fit: one that isn't at its best yet may predict badly, and fit best.
        k = min(range(len(results)), key=lambda k: of_frames(results[k].solved))
        found = results[k]
        if found.gain < of_frames(without) - of_frames(found.solved) and found.gain < max(t.gain for t in results):
            results[k] = trial(problem.solve(found.solved.terms, found.solved.calibration, leftover=instrument))
    first = _unfulfilled(candidates, results, least)
    elsewhere = None if first is None else settle(results[first].solved)
    if first is not None and elsewhere is not None and elsewhere.solved.leftover == without.leftover:
        results[first] = max(results[first], trial(elsewhere.solved, elsewhere.problem), key=lambda t: t.gain)
    return results


def _unfulfilled(candidates: Sequence[Candidate], trials: Sequence[Trial], least: float) -> int | None:
    """Which trial is that of the first candidate of few numbers, where that one, expected to be worth a name, gains far
    less than expected.

    A contact that lands millimetres off, or a sheet that warms by a tenth, is far from where the skin is linearised;
    what is fitted there is fitted to another skin.
    """
    first = next((c for c in candidates if c.term.modes is None), None)
    if first is None or first.gain <= least:
        return None
    for k, trial in enumerate(trials):
        if trial.term.name == first.name and form_of(trial.term) == form_of(first.term):
            return k if trial.gain < FULFILLED * first.gain else None
    return None


def _with_remainders(
    problem: VoltageProblem, trials: Sequence[Trial], partitions: Sequence[Sequence[int]], least: float
) -> Iterator[Solved]:
    """The best form of few numbers of each property that varies, and a smooth field for what it leaves, where both
    together are expected to gain the ``least`` (half chi-square)."""
    forms = [t for t in trials if t.term.effect.hypothesis.field and t.term.modes is None and t.gain > 0]
    for name in dict.fromkeys(t.term.name for t in forms):
        best = min((t for t in forms if t.term.name == name), key=lambda t: of_frames(t.solved))
        number = len(best.solved.terms) - 1
        both = with_smooth_field(problem, best.solved, number, partitions, least - best.gain)
        if both is not None:
            yield both


def _with_candidate(problem: VoltageProblem, current: Solved, candidate: Candidate, leftover: bool) -> Solved:
    """The fit with one more term, from where of its starts it fits best."""
    begun = (_with_term(problem, current, term, leftover) for term in (candidate.term, *candidate.others))
    return min(begun, key=lambda fit: fit.cost)


def _with_term(problem: VoltageProblem, current: Solved, term: Term, leftover: bool) -> Solved:
    """The fit with one more term. A start to first order may lie where no descent comes back from: then from nearer."""
    fits: list[Solved] = []
    for share in SHARES:
        terms = [*current.terms, term.nearer(share)]
        fits.append(problem.solve(terms, current.calibration, steps=4, leftover=leftover))
        if fits[-1].cost <= current.cost:
            break
    return min(fits, key=lambda fit: fit.cost)


def _shown_at_rest(problem: VoltageProblem, current: Solved, drifting: Solved) -> bool:
    """Whether a drift is seen where nothing presses: what changes from press to press alone may be the places."""
    rows = problem.evidence.rest & (problem.weight > 0)
    change = (current.scan_residual[rows] ** 2).sum() - (drifting.scan_residual[rows] ** 2).sum()
    return bool(0.5 * change > problem.evidence.criteria.significant_gain)


def material_cost(numbers: int, cost: float, ratio: float) -> float:
    """Half chi-square that a change of the rms over the noise by this ``ratio`` amounts to, of so many scans' numbers.

    ``cost``: half their chi-square; what no network explains has no part in either.
    """
    return 0.5 * numbers * (ratio**2 - 1) * max(1.0, 2 * cost / numbers) ** 0.5


def of_scans(solved: Solved) -> float:
    """Half chi-square of the scans fitted."""
    return 0.5 * float((solved.scan_residual**2).sum())


def of_frames(solved: Solved) -> float:
    """Half chi-square of the frames fitted; the specimen's, which cells held out don't hold either, is left out."""
    return float(solved.fit.quadratic.cost[:-1].sum())


def residual_count(problem: VoltageProblem) -> int:
    return int((problem.weight > 0).sum()) * problem.evidence.scan_v.shape[1]


def rms_of(solved: Solved) -> float:
    rows = solved.scan_residual.any(axis=1)
    return float(np.sqrt((solved.scan_residual[rows] ** 2).mean())) if rows.any() else 0.0


def unlikely(solved: Solved) -> float:
    """Half chi-square of the frames fitted and what the freedom of smooth fields costs."""
    return of_frames(solved) + freedom(solved)
