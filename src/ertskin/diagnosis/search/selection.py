"""Which effects a recording shows: forward selection by held-out likelihood, then backward, with what else would do."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import Rival, Tried
from ertskin.diagnosis.fit.full_solution_check import WORSE, Standing, exact, settled, standing
from ertskin.diagnosis.fit.joint_fit import Solved, Term, VoltageProblem
from ertskin.diagnosis.linear.calibration_vector import WIDEST_RATIO, Calibration
from ertskin.diagnosis.search.candidates import Candidate, screen
from ertskin.diagnosis.search.forms import form_of, freer
from ertskin.diagnosis.search.gain import freedom, gained
from ertskin.diagnosis.search.smooth_fields import with_smooth_field, with_smooth_fields
from ertskin.diagnosis.specimen.agreement import remembers_alike
from ertskin.physics.conduction.mesh import MeshError
from ertskin.physics.effects.effect import ElectrodeEffect, PiezoEffect, shown_by
from ertskin.physics.effects.hypothesis import Measured, Signal

Array = NDArray[np.float64]

SIGNIFICANT = 15.0
"""Held-out gain in half chi-square that a term must reach: far above what the best of 200 null candidates gains."""
MATERIAL = 1.03
"""A term must bring the residual's rms down by this factor of what noise alone leaves, or it isn't worth a name."""
KNOWN = 1.05
"""Factor within which a term of a name that is in the fit already gains as much as one of another name."""
TRIED = 3
WORTH_TRYING = 0.15
"""Least part of the best candidate's expected gain that makes another worth a fit."""
SHARES = 1.0, 0.3, 0.1
"""Of a candidate's size, at which it is begun."""
RUN_AWAY = 0.4
"""Part of the widest ratio of moduli from which on a fit is taken to have run away."""
ALIKE = 0.5
"""Part of the best form's gain from which another form of the same effect is settled too."""
MOST_TERMS = 5
FORMS = 2
"""How many forms of one effect are settled."""
REFINED = 4
STILL = 0.97
"""Part of the misfit down to which freeing forms once more isn't worth it."""

Report = Callable[[float | None, str], None]
Rivals = tuple[Rival, ...]
Problem = Callable[[Solved | None], VoltageProblem]


@dataclass(frozen=True, eq=False)
class Chosen:
    """A selected term: what the fit loses without it and what the best other candidate gains in its stead.

    ``ratio_alone``: rms over noise that this term by itself would make, on frames held out.
    """

    term: Term
    loss: float
    ratio_alone: float
    rivals: Rivals


@dataclass(frozen=True, eq=False)
class Trial:
    """A candidate fitted beside the terms at hand, and the half chi-square that it gains held out."""

    term: Term
    gain: float
    solved: Solved


@dataclass(frozen=True, eq=False)
class Selection:
    """What was found on the frames fitted: the fits without and with the terms, and each term's standing.

    ``tried``: the sets fitted, in order; ``specimen`` whether it "agrees" or "disagrees" with the skin, None without.
    """

    before: Solved
    after: Solved
    chosen: tuple[Chosen, ...]
    problem: VoltageProblem
    tried: tuple[Tried, ...]
    specimen: str | None = None


def select(
    build: Problem,
    fixed: Sequence[Term],
    begun: Sequence[tuple[Term, Rivals]],
    start: Calibration,
    partitions: Sequence[Sequence[int]],
    report: Report,
) -> Selection:
    """Grow the set of terms while one gains, held out, what is significant and material.

    ``build`` linearises about a fit (or about the start); ``fixed`` terms (the force stage's) belong to every model;
    ``begun`` are terms that another signal has shown, with their rivals there: they must hold their own here.
    """
    problem = build(None)
    report(0.15, "fitting the calibration")
    here = standing(problem, problem.solve(fixed, start))
    if here.strays:
        here = settled(build, here.solved)
    before = here.solved
    if begun:
        there = _begun(build, here, [*fixed, *(term for term, _ in begun)])
        if there is not None:
            here, fixed = _without_drifts(build, there, fixed)
        # A form is freed about the fit itself: further off it would mend what linearising leaves.
        here = _refined(build, here, partitions)
    tried: list[Tried] = []
    stand: dict[str, Rivals] = {_key(term): rivals for term, rivals in begun}
    for turn in range(MOST_TERMS):
        problem, current = here.problem, here.problem.at_hand(here.solved)
        least = max(SIGNIFICANT, material_cost(_residual_count(problem), _of_scans(current)))
        report(0.2 + 0.1 * turn, f"looking for what is missing (residual {_rms(current):.3f} of the noise)")
        found = screen(problem, current, partitions)
        trials: list[Trial] = []
        for listed in _worth_trying(found, least):
            trials = _in_order([*trials, *_try(problem, current, _different(listed), partitions)], current)
            if trials and trials[0].gain >= least:
                break
        entered = _first_to_hold(build, here, [t for t in trials if t.gain >= least])
        tried += [_as_tried(t, entered is not None and t.term == entered[0].term) for t in trials]
        if entered is None:
            break
        trial, here = entered
        others = [t for t in trials if t.term.name != trial.term.name and t.gain <= KNOWN * trial.gain]
        stand[_key(trial.term)] = tuple(Rival(t.term.effect, trial.gain - t.gain) for t in others)
        here = _refined(build, _reconsidered(build, here), partitions)
        report(0.25 + 0.1 * turn, f"{trial.term.name} enters")
    chosen, current = _backward(here.problem, here.solved, len(fixed), partitions, stand)
    problem = here.problem
    there = _where_it_settles(build, problem, current)
    if there is not None and there.problem is not problem:
        # What is left may fit as well elsewhere only because the skin was linearised far from there.
        problem = there.problem
        chosen, current = _backward(problem, there.solved, len(fixed), partitions, stand)
    problem, current, specimen = _judged(problem, current, bool(chosen))
    return Selection(before, current, chosen, problem, tuple(tried), specimen)


def _as_tried(trial: Trial, kept: bool) -> Tried:
    return Tried(tuple(term.name for term in trial.solved.terms), trial.gain, kept)


def _judged(problem: VoltageProblem, current: Solved, named: bool) -> tuple[VoltageProblem, Solved, str | None]:
    """The fit where the skin is solved in full, by its own readings alone where the specimen disagrees with it.

    The sheet that a last step leads to may not be one that can be meshed: then the fit stays as it is.
    """
    said = None
    if problem.specimen is not None:
        said = "agrees" if remembers_alike(problem.specimen, current.effects) else "disagrees"
    if said == "disagrees":
        problem = replace(problem, specimen=None)
        current = problem.solve(current.terms, current.calibration)
    if not named:
        return problem, current, said
    try:
        return *exact(problem, current), said
    except (MeshError, np.linalg.LinAlgError):
        return problem, current, said


def _reconsidered(build: Problem, here: Standing) -> Standing:
    """The fit begun again from the nominal ratio of moduli, where that fits better than a ratio far from it.

    A ratio that made up for a missing effect doesn't come back by itself once the effect is there.
    """
    solved = here.solved
    if abs(solved.calibration.log_ratio) < RUN_AWAY * WIDEST_RATIO:
        return here
    again = here.problem.solve(solved.terms, replace(solved.calibration, log_ratio=0.0))
    if again.cost >= solved.cost:
        return here
    there = _where_it_settles(build, here.problem, again)
    return here if there is None or there.spoils(here) else there


def _begun(build: Problem, plain: Standing, terms: Sequence[Term]) -> Standing | None:
    """The fit with terms that another signal has shown; a pad that lies elsewhere needs a mesh of its own first."""
    calibration = plain.solved.calibration
    displaced = [
        int(getattr(t.effect, "electrode", -1))
        for t in terms
        if isinstance(t.effect, ElectrodeEffect) and t.effect.displaces()
    ]
    if displaced:
        contacts = np.array(calibration.contact_ohm)
        # What its contact was fitted to at the wrong place says nothing.
        contacts[displaced] = np.median(contacts)
        begin = plain.problem.solve(terms, replace(calibration, contact_ohm=contacts), steps=0)
    else:
        begin = plain.problem.solve(terms, calibration)
    return _where_it_settles(build, None, begin)


def _without_drifts(build: Problem, here: Standing, fixed: Sequence[Term]) -> tuple[Standing, Sequence[Term]]:
    """The fit and its fixed terms without contacts that wander, where places that creep explain as much at rest."""
    creeps = any(
        isinstance(t.effect, PiezoEffect) and getattr(t.effect, "remembers_air", False) for t in here.solved.terms
    )
    still = [term for term in here.solved.terms if not _path_of_contact(term)]
    if not creeps or len(still) == len(here.solved.terms):
        return here, fixed
    there = _where_it_settles(build, None, here.problem.solve(still, here.solved.calibration))
    if there is None or there.spoils(here) or _at_rest(there) > WORSE * _at_rest(here):
        return here, fixed
    return there, [term for term in fixed if not _path_of_contact(term)]


def _path_of_contact(term: Term) -> bool:
    return term.effect.hypothesis.measured == Measured.CONTACT_PATH


def _at_rest(here: Standing) -> float:
    """Misfit over noise where nothing presses."""
    rows = here.problem.evidence.rest & (here.problem.weight > 0)
    return float(np.sqrt(np.mean(here.solved.scan_residual[rows] ** 2))) if rows.any() else 0.0


def _first_to_hold(build: Problem, here: Standing, trials: Sequence[Trial]) -> tuple[Trial, Standing] | None:
    """The first trial that, settled, fits frames solved in full no worse than what is there, and where it settles.

    Of forms of one name that gain about as much the one that then fits best, with the best one's gain: what a fit in
    the skin linearised elsewhere gains doesn't tell between them.
    """
    left = list(trials)
    while left:
        first = left[0]
        alike = [t for t in left if t.term.name == first.term.name and t.gain > ALIKE * first.gain]
        left = [t for t in left if t not in alike]
        forms = alike if len(alike) <= FORMS else sorted(alike, key=lambda t: _unlikely(t.solved))[:FORMS]
        places = [(form, _where_it_settles(build, None, form.solved)) for form in forms]
        held = [(form, there) for form, there in places if there is not None and not there.spoils(here)]
        if held:
            form, there = min(held, key=lambda pair: pair[1].misfit)
            return replace(form, gain=first.gain), there
    return None


def _unlikely(solved: Solved) -> float:
    """Half chi-square of the frames fitted and what the freedom of smooth fields costs."""
    return _of_frames(solved) + freedom(solved)


def _where_it_settles(build: Problem, problem: VoltageProblem | None, solved: Solved) -> Standing | None:
    """Where a fit comes to rest; made with ``problem`` it may hold as it is. None where there is no such sheet."""
    try:
        if problem is not None:
            there = standing(problem, solved)
            if not there.strays:
                return there
        return settled(build, solved)
    except (MeshError, np.linalg.LinAlgError):
        return None


def _worth_trying(found: Sequence[Candidate], least: float) -> list[list[Candidate]]:
    """The candidates to fit, the second list where nothing of the first is worth a name.

    What no resistor network explains only the instrument can: it comes first. An instrument that would gain less than
    ``least`` wouldn't be named, and doesn't keep the others from their turn.
    """
    instrument = [c for c in found if shown_by(c.term.effect, Signal.NONRECIPROCAL) and c.gain > least]
    others = [c for c in found if not shown_by(c.term.effect, Signal.NONRECIPROCAL)]
    listed = [[c for c in instrument if c.gain > WORTH_TRYING * instrument[0].gain]] if instrument else []
    if others:
        listed.append([c for c in others if c.gain > max(SIGNIFICANT, WORTH_TRYING * others[0].gain)])
    return listed


def _in_order(trials: Sequence[Trial], current: Solved) -> list[Trial]:
    """By what they gain; where two gain alike, the one whose name is in the fit already is the likelier."""
    present = {term.name for term in current.terms}
    return sorted(trials, key=lambda t: -t.gain * (KNOWN if t.term.name in present else 1.0))


def material_cost(numbers: int, cost: float) -> float:
    """Half chi-square that a change of the rms by ``MATERIAL`` over the noise amounts to, of so many scans' numbers.

    ``cost``: half their chi-square; what no network explains has no part in either.
    """
    return 0.5 * numbers * (MATERIAL**2 - 1) * max(1.0, 2 * cost / numbers) ** 0.5


def _of_scans(solved: Solved) -> float:
    """Half chi-square of the scans fitted."""
    return 0.5 * float((solved.scan_residual**2).sum())


def _of_frames(solved: Solved) -> float:
    """Half chi-square of the frames fitted; the specimen's, which cells held out don't hold either, is left out."""
    return float(solved.fit.quadratic.cost[:-1].sum())


def _residual_count(problem: VoltageProblem) -> int:
    return int((problem.weight > 0).sum()) * problem.evidence.scan_v.shape[1]


def _rms(solved: Solved) -> float:
    rows = solved.scan_residual.any(axis=1)
    return float(np.sqrt((solved.scan_residual[rows] ** 2).mean())) if rows.any() else 0.0


def _key(term: Term) -> str:
    return f"{term.name}:{getattr(term.effect, 'electrode', getattr(term.effect, 'channel', ''))}"


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
) -> list[Trial]:
    """Each candidate fitted for good."""
    results = []
    instrument = any(shown_by(c.term.effect, Signal.NONRECIPROCAL) for c in candidates)
    plain = problem.solve(current.terms, current.calibration, steps=1, leftover=True) if instrument else current

    def trial(solved: Solved) -> Trial:
        return Trial(solved.terms[-1], gained(plain, solved, partitions), solved)

    problem.reuse = True
    for candidate in candidates:
        solved = _beside(problem, plain, candidate.term, instrument)
        if candidate.term.effect.hypothesis.must_show_at_rest and not _shown_at_rest(problem, current, solved):
            continue
        results.append(trial(solved))
    problem.reuse = False
    results += [trial(both) for both in _with_remainders(problem, results, partitions)]
    if results:
        # Cells are predicted by a step from the fit: one that isn't at its best yet may predict badly, and fit best.
        k = min(range(len(results)), key=lambda k: _of_frames(results[k].solved))
        found = results[k]
        if found.gain < _of_frames(plain) - _of_frames(found.solved) and found.gain < max(t.gain for t in results):
            results[k] = trial(problem.solve(found.solved.terms, found.solved.calibration, leftover=instrument))
    return results


def _with_remainders(
    problem: VoltageProblem, trials: Sequence[Trial], partitions: Sequence[Sequence[int]]
) -> Iterator[Solved]:
    """The best form of few numbers of each property that varies, and a smooth field for what it leaves."""
    forms = [t for t in trials if t.term.effect.hypothesis.field and t.term.modes is None and t.gain > 0]
    for name in dict.fromkeys(t.term.name for t in forms):
        best = min((t.solved for t in forms if t.term.name == name), key=_of_frames)
        both = with_smooth_field(problem, best, len(best.terms) - 1, partitions)
        if both is not None:
            yield both


def _beside(problem: VoltageProblem, current: Solved, term: Term, leftover: bool) -> Solved:
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
    return bool(0.5 * change > SIGNIFICANT)


def _refined(build: Problem, here: Standing, partitions: Sequence[Sequence[int]]) -> Standing:
    """Free what selection held, where that predicts better: a loop's shape, time constants of creep, smooth fields.

    What has taken the fit far is settled, and what was freed about the old place freed about the new one again.
    """
    for _ in range(REFINED):
        freed = _freed(here, partitions)
        if freed is here.solved:
            break
        there = _where_it_settles(build, here.problem, freed)
        if there is None or there.spoils(here):
            break
        before, here = here, there
        if here.misfit > STILL * before.misfit:
            break
    return here


def _freed(here: Standing, partitions: Sequence[Sequence[int]]) -> Solved:
    problem, current = here.problem, here.solved
    for number, term in enumerate(current.terms):
        for form in freer(term):
            terms = [*current.terms[:number], form, *current.terms[number + 1 :]]
            freed = problem.solve(terms, current.calibration)
            gain = gained(current, freed, partitions)
            # No name hangs on a form, and so few numbers can't lower the misfit that much by chance.
            if gain > SIGNIFICANT or _of_frames(freed) < STILL**2 * _of_frames(current):
                current = freed
    return with_smooth_fields(problem, current, partitions)


def _backward(
    problem: VoltageProblem,
    current: Solved,
    fixed: int,
    partitions: Sequence[Sequence[int]],
    stand: dict[str, Rivals],
) -> tuple[tuple[Chosen, ...], Solved]:
    """Drop terms the others have made superfluous; what each of the rest is worth."""
    frames = _residual_count(problem)
    while True:
        instrument = any(shown_by(t.effect, Signal.NONRECIPROCAL) for t in current.terms)
        if instrument:
            current = problem.solve(current.terms, current.calibration, steps=2, leftover=True)
        chosen, dropped = [], None
        for k in range(fixed, len(current.terms)):
            rest = [t for i, t in enumerate(current.terms) if i != k]
            without = problem.solve(rest, current.calibration, steps=5, leftover=instrument)
            loss = gained(without, current, partitions)
            least = max(SIGNIFICANT, material_cost(frames, _of_scans(current)))
            if loss < least and (dropped is None or loss < dropped[0]):
                dropped = (loss, without)
            term = current.terms[k]
            # The instrument's terms gain in every reading, the others in the pairs.
            width = problem.evidence.protocol.orthonormal.shape[0 if shown_by(term.effect, Signal.NONRECIPROCAL) else 1]
            alone = float(np.sqrt(1 + 2 * max(loss, 0.0) / (frames * width / problem.evidence.scan_v.shape[1])))
            chosen.append(Chosen(term, loss, alone, stand.get(_key(term), ())))
        if dropped is None:
            return tuple(chosen), current
        current = dropped[1]
