"""One effect in another's place: of two that explain nearly the same, the first to enter hides the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from ertskin.diagnosis.fit.full_solution_check import CheckedFit, Problem
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.nonreciprocal import acquires
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.behind_fields import spare_evidence
from ertskin.diagnosis.search.gain import freedom, gained
from ertskin.diagnosis.search.settling import refined, where_it_settles
from ertskin.diagnosis.search.trials import Trial

MENDED = 1.5
"""Times the half chi-square at hand up to which freeing its forms may make a swap the likelier one."""
HOPELESS = 3.0
"""Times the half chi-square at hand that a swap may be expected to have, by the local model of the fit with both terms:
of fourteen swaps on ``c002`` of ``ninth24`` (02c6608) nine were expected at 4.12 to 4.14 and came to 4.13 to 4.18, five
at 1.00 and came to 1.00."""


@dataclass(frozen=True, eq=False)
class _Swap:
    """The fit at hand, the term that leaves it, and the fit with another in its place; both count the same readings."""

    present: Solved
    left: Term
    solved: Solved


def exchanged(
    build: Problem,
    incumbent: CheckedFit,
    trials: Sequence[Trial],
    fixed: int,
    partitions: Sequence[Sequence[int]],
) -> tuple[Term, CheckedFit, float] | None:
    """The term that leaves, the fit with a trial's term in its place, and the half chi-square gained.

    None where that isn't significant: held out, and in all that is fitted, the specimen with it. Fields take nobody's
    place: they mend whatever is wrong with the others' forms. The first ``fixed`` terms stay.
    """
    swap = max(_swaps(incumbent, trials, fixed), key=lambda swap: swap.present.cost - swap.solved.cost, default=None)
    if swap is None or swap.solved.cost > MENDED * swap.present.cost:
        return None
    proposed = where_it_settles(build, None, swap.solved)
    if proposed is None:
        return None
    # The one that leaves has had its forms freed.
    proposed = refined(build, proposed, partitions)
    if proposed.spoils(incumbent):
        return None
    found = counting_leftover(proposed.problem, proposed.solved, swap.present.leftover)
    criteria = incumbent.problem.evidence.criteria
    fitted = _likelier(swap.present, found)
    gain = min(fitted, gained(swap.present, found, partitions, criteria))
    return (swap.left, proposed, gain) if gain > criteria.significant_gain else None


def leaves_a_mismatch(fit: CheckedFit) -> bool:
    """Whether a fit misses the scans, what no network explains or the specimen's readings by more than a mismatch."""
    problem, most = fit.problem, fit.problem.evidence.criteria.mismatch_ratio
    if fit.misfit > most:
        return True
    skin = problem.family.skin(fit.solved.calibration, fit.solved.effects)
    beyond = problem.acquisition.residual(skin)
    others = [beyond[beyond != 0], np.zeros(0) if problem.specimen is None else problem.specimen.residual(skin)]
    return any(float(np.sqrt((missed**2).mean())) > most for missed in others if missed.size)


def _swaps(incumbent: CheckedFit, trials: Sequence[Trial], fixed: int) -> Iterator[_Swap]:
    """Every term that a trial's may be taken for, and the trial's fit without it, unless that is hopeless."""
    problem, current = incumbent.problem, incumbent.solved
    names = {term.name for term in current.terms}
    counting = cache(partial(counting_leftover, problem, current))
    for trial in trials:
        if trial.term.name in names or trial.term.effect.hypothesis.field:
            continue
        *others, new = trial.solved.terms
        for k, term in enumerate(current.terms):
            if k >= fixed and term.modes is None and _alike(term, new):
                rest = [*others[:k], *others[k + 1 :], new]
                # Scans and what no network explains count on both sides, or on none.
                both = acquires(current.effects) or acquires([one.effect for one in rest])
                present = counting(both)
                if trial.solved.rise_without(k) <= (HOPELESS - 1) * present.cost:
                    yield _Swap(present, term, problem.solve(rest, trial.solved.calibration, leftover=both))


def gain_of_exchange(present: CheckedFit, proposed: CheckedFit) -> float:
    """By how much (half chi-square, with what the freedom of fields costs) a proposed fit is likelier than the present
    one, the specimen's readings with it: both count what no network explains, or neither, and smooth fields have the
    likeliest covariance."""
    both = acquires(present.solved.effects) or acquires(proposed.solved.effects)
    found = [counting_leftover(fit.problem, fit.solved, both) for fit in (present, proposed)]
    spare = [spare_evidence(fit.problem, one) for fit, one in zip((present, proposed), found, strict=True)]
    return _likelier(*found) + spare[1] - spare[0]


def _likelier(present: Solved, proposed: Solved) -> float:
    return present.cost + freedom(present) - proposed.cost - freedom(proposed)


def counting_leftover(problem: VoltageProblem, solved: Solved, leftover: bool) -> Solved:
    """The fit that counts what no network explains, or one that doesn't."""
    if solved.leftover == leftover:
        return solved
    return problem.solve(solved.terms, solved.calibration, steps=1, leftover=leftover)


def _alike(one: Term, other: Term) -> bool:
    """Whether the wrong form of one may look like the other."""
    return bool(one.effect.hypothesis.kin & other.effect.hypothesis.kin)
