"""Where a fit comes to rest: linearised about itself, its forms freed where that predicts better."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ertskin.diagnosis.fit.full_solution_check import CheckedFit, Problem, checked_fit, settled
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.forms import freer
from ertskin.diagnosis.search.gain import gained
from ertskin.diagnosis.search.smooth_fields import with_smooth_fields
from ertskin.diagnosis.search.trials import of_frames
from ertskin.physics.conduction.mesh import MeshError
from ertskin.physics.effects.effect import AcquisitionEffect, Stage

REFINED = 4
"""How many times forms are freed and the fit settled."""
Freeing = Callable[[CheckedFit, Sequence[Sequence[int]]], Solved]
"""What makes a fit with more of it free, by partitions of its cells; the fit itself where that predicts no better."""
HOPELESS = 3.0
"""Times the half chi-square at hand above which a freer form, begun, is given up: creep in powers on
``known_piezo_creep`` is after four steps at 1.1 times and comes to 0.998, as a factor at 9.9 and comes to 9.4."""
STILL = 0.97
"""Part of the misfit down to which freeing forms once more isn't worth it."""


def where_it_settles(build: Problem, problem: VoltageProblem | None, solved: Solved) -> CheckedFit | None:
    """Where a fit comes to rest; made with ``problem`` it may hold as it is. None where there is no such sheet."""
    try:
        if problem is not None:
            checked = checked_fit(problem, solved)
            if checked.holds:
                return checked
        return settled(build, solved)
    except (MeshError, np.linalg.LinAlgError):
        return None


def spread(fit: CheckedFit, partitions: Sequence[Sequence[int]]) -> Solved:
    """The fit with smooth fields spread otherwise, where that predicts better."""
    return with_smooth_fields(fit.problem, fit.solved, partitions)


def freed_forms(fit: CheckedFit, partitions: Sequence[Sequence[int]]) -> Solved:
    """The fit with what selection held freed, where that predicts better: a loop's shape, time constants of creep,
    smooth fields."""
    problem, current = fit.problem, fit.solved
    criteria = problem.evidence.criteria
    for number, term in enumerate(current.terms):
        for form in freer(term):
            terms = [*current.terms[:number], form, *current.terms[number + 1 :]]
            hopeless = HOPELESS * current.cost
            freed = problem.solve(terms, current.calibration, leftover=current.leftover, hopeless=hopeless)
            gain = gained(current, freed, partitions, criteria)
            # No name hangs on a form, and so few numbers can't lower the misfit that much by chance.
            if gain > criteria.significant_gain or of_frames(freed) < STILL**2 * of_frames(current):
                current = freed
    return with_smooth_fields(problem, current, partitions)


def refined(
    build: Problem,
    incumbent: CheckedFit,
    partitions: Sequence[Sequence[int]],
    free: Freeing = freed_forms,
) -> CheckedFit:
    """The fit with more of it free, where that predicts better.

    What has taken the fit far is settled, and what was freed about the old place freed about the new one again.
    """
    for _ in range(REFINED):
        if incumbent.freed is incumbent.solved or incumbent.problem.evidence.work.ends():
            break
        freed = free(incumbent, partitions)
        proposed = None if freed is incumbent.solved else where_it_settles(build, incumbent.problem, freed)
        if proposed is None or proposed.spoils(incumbent):
            return replace(incumbent, freed=incumbent.solved)
        before, incumbent = incumbent, proposed
        if incumbent.misfit > STILL * before.misfit and not _instrument_offers_more(before.solved, incumbent.solved):
            break
    return incumbent


def _instrument_offers_more(before: Solved, after: Solved) -> bool:
    """Whether numbers can be freed of an effect on readings alone, as freed, that couldn't before.

    Such a form may gain little until they are: where driven electrodes aren't read, what each channel keeps of the one
    before left 1.513 of 1.559, contacts that the multiplexer passes then 1.029 (``c020`` of ``twentyeighth48``).
    """

    def offered(term: Term) -> set[str]:
        if term.effect.stage != Stage.ACQUISITION or not isinstance(term.effect, AcquisitionEffect):
            return set()
        return {key for form in freer(term) for key in form.free} - {*term.free}

    return any(offered(a) - offered(b) for a, b in zip(after.terms, before.terms, strict=True))
