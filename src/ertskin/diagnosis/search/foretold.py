"""Whether the terms chosen predict presses within the fitted part: each cell by a fit of all the others.

The presses that the misfit is reported on have no say in what is chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.joint_fit import Solved, VoltageProblem, held_out
from ertskin.diagnosis.search.selection import Selection
from ertskin.diagnosis.search.trials import of_scans

STEPS = 6


def that_foretells(selection: Selection, partitions: Sequence[Sequence[int]]) -> Selection:
    """The selection; without its terms where cells held out are predicted worse with them than without.

    A step from the fit, which costs nothing, is asked first: as good as the fit without the terms is to all cells, no
    prediction without them can be.
    """
    problem, before, after = selection.problem, selection.before, selection.after
    most = problem.evidence.criteria.mismatch_ratio**2
    if not selection.chosen or held_out(after, partitions).sum() <= most * of_scans(before):
        return selection
    without = problem.solve(before.terms, before.calibration)
    if cost_held_out(problem, after, partitions) <= most * cost_held_out(problem, without, partitions):
        return selection
    return replace(selection, after=before, chosen=())


def cost_held_out(problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]]) -> float:
    """Half chi-square of the cells' scans, each of them held out and predicted by the same terms fitted to the rest."""
    return sum(_cost_of(problem, solved, np.isin(problem.cells, out)) for out in partitions)


def _cost_of(problem: VoltageProblem, solved: Solved, out: NDArray[np.bool_]) -> float:
    inside = replace(problem, weight=np.where(out, 0.0, problem.weight))
    fit = inside.solve(solved.terms, solved.calibration, steps=STEPS)
    residual = problem.scan_residual(problem.family.skin(fit.calibration, fit.effects))
    return 0.5 * float((residual[out] ** 2).sum())
