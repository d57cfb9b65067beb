"""One effect in another's place: of two that explain nearly the same, the first to enter hides the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ertskin.diagnosis.fit.full_solution_check import CheckedFit, Problem
from ertskin.diagnosis.fit.joint_fit import Solved, Term, held_out
from ertskin.diagnosis.search.settling import refined, where_it_settles
from ertskin.diagnosis.search.trials import Trial, of_frames, unlikely

MENDED = 1.5
"""Times the half chi-square at hand up to which freeing its forms may make a swap the likelier one."""


def exchanged(
    build: Problem,
    incumbent: CheckedFit,
    trials: Sequence[Trial],
    fixed: int,
    partitions: Sequence[Sequence[int]],
) -> tuple[Term, CheckedFit, float] | None:
    """The term that leaves, the fit with a trial's term in its place, and the half chi-square gained.

    None where that isn't significant, in the fit as well as held out.

    Fields take nobody's place: they mend whatever is wrong with the others' forms. The first ``fixed`` terms stay.
    """
    current = incumbent.solved
    swaps = list(_swaps(incumbent, trials, fixed))
    if not swaps:
        return None
    left, solved = min(swaps, key=lambda swap: of_frames(swap[1]))
    if of_frames(solved) > MENDED * of_frames(current):
        return None
    proposed = where_it_settles(build, None, solved)
    if proposed is None:
        return None
    # The one that leaves has had its forms freed.
    proposed = refined(build, proposed, partitions)
    if proposed.spoils(incumbent):
        return None
    fitted = unlikely(current) - unlikely(proposed.solved)
    foretold = float((held_out(current, partitions) - held_out(proposed.solved, partitions)).sum())
    gain = min(fitted, foretold)
    return (left, proposed, gain) if gain > incumbent.problem.evidence.criteria.significant_gain else None


def _swaps(incumbent: CheckedFit, trials: Sequence[Trial], fixed: int) -> Iterator[tuple[Term, Solved]]:
    """Every term that a trial's may be taken for, and the trial's fit without it."""
    problem, present = incumbent.problem, {term.name for term in incumbent.solved.terms}
    for trial in trials:
        if trial.term.name in present or trial.term.modes is not None:
            continue
        *others, new = trial.solved.terms
        for k, term in enumerate(others):
            if k >= fixed and term.modes is None and _alike(term, new):
                rest = [*others[:k], *others[k + 1 :], new]
                yield term, problem.solve(rest, trial.solved.calibration, leftover=trial.solved.leftover)


def _alike(one: Term, other: Term) -> bool:
    """Whether the wrong form of one may look like the other."""
    return bool(one.effect.hypothesis.kin & other.effect.hypothesis.kin)
