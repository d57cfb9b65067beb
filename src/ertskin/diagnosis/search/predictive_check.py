"""Whether the terms chosen predict presses within the fitted part: each cell by a fit of all the others.

The presses that the misfit is reported on have no say in what is chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.cells_held_out import held_out
from ertskin.diagnosis.fit.cross_validation import log_misfit, numbers_of, refitted, scans_by_part
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.search.chosen import Selection

Array = NDArray[np.float64]


def _by_a_step(problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]]) -> Array:
    """(len(partitions),) half chi-square of the cells' scans after a step to the fit of all the others.

    Of what no network explains, which a fit without the instrument's names doesn't count, only the change is in it.
    """
    cost = solved.fit.quadratic.cost
    change = held_out(solved, partitions) - np.array([cost[list(out)].sum() for out in partitions])
    return scans_by_part(problem, solved, partitions) + change


def _without_what_predicts_nothing(problem: VoltageProblem, solved: Solved) -> Solved:
    """The fit without fields told place by place, of which places held out are to know nothing."""
    rest = [term for term in solved.terms if not term.by_place]
    return solved if len(rest) == len(solved.terms) else problem.solve(rest, solved.calibration)


def that_predicts(selection: Selection, partitions: Sequence[Sequence[int]]) -> Selection:
    """The selection; without its terms where cells held out are predicted worse with them than without.

    A step from the fit, which costs nothing, is asked first: as good as the fit without the terms is to all cells, no
    prediction without them can be.
    """
    problem, before = selection.problem, selection.before
    after = _without_what_predicts_nothing(problem, selection.after)
    numbers = numbers_of(problem, partitions)
    allowed = numbers.sum() * np.log(problem.evidence.criteria.mismatch_ratio)
    fitted = scans_by_part(problem, before, partitions)
    if not selection.chosen or log_misfit(_by_a_step(problem, after, partitions), numbers) <= (
        log_misfit(fitted, numbers) + allowed
    ):
        return selection
    without = problem.solve(before.terms, before.calibration)
    with_terms, alone = (log_misfit(refitted(problem, fit, partitions), numbers) for fit in (after, without))
    return selection if with_terms <= alone + allowed else replace(selection, after=before, chosen=())
