"""What terms predict of cells held out, each predicted by a whole fit of the same terms to all the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved

Array = NDArray[np.float64]

STEPS = 6
LEAST_MISFIT = 0.5
"""Least mean square, in units of the noise, that counts."""


def log_misfit(cost: Array, numbers: Array) -> float:
    """Negative logarithm of the likelihood of cells (K,) with half chi-square ``cost`` over so many ``numbers`` each,
    the size of what a cell is missed by being as unknown as for the others.

    Where cells are missed by about the noise it changes as half chi-square does. The one cell that none of the others
    tells of (the only press on a hill) doesn't outweigh them: twelve presses on `rig_a` were missed by 1.1 of the noise
    each but two by 8, which chose a field that missed presses elsewhere by 2.5 where the best one has 1.13.
    """
    return float((np.maximum(numbers, 1) * log_misfits(cost, numbers)).sum())


def log_misfits(cost: Array, numbers: Array) -> Array:
    """(K,) logarithm of the rms by which each cell is missed: what each of its numbers adds to ``log_misfit``."""
    return np.asarray(0.5 * np.log(np.maximum(2 * cost / np.maximum(numbers, 1), LEAST_MISFIT)))


def numbers_of(problem: VoltageProblem, partitions: Sequence[Sequence[int]]) -> Array:
    """(len(partitions),) how many numbers of scans the cells of each part hold."""
    fitted = np.bincount(problem.cells, problem.weight > 0, minlength=problem.cell_count)
    return problem.evidence.scan_v.shape[1] * np.array([fitted[list(out)].sum() for out in partitions], dtype=float)


def refitted(problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]]) -> Array:
    """(len(partitions),) half chi-square of the cells' scans, each part held out and predicted by the same terms fitted
    to the rest."""
    return np.array([_cost_of(problem, solved, np.isin(problem.cells, out)) for out in partitions])


def log_misfit_held_out(problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]]) -> float:
    """``log_misfit`` of cells each held out and predicted by a whole fit to the others."""
    return log_misfit(refitted(problem, solved, partitions), numbers_of(problem, partitions))


def _cost_of(problem: VoltageProblem, solved: Solved, out: NDArray[np.bool_]) -> float:
    inside = replace(problem, weight=np.where(out, 0.0, problem.weight))
    fit = inside.solve(solved.terms, solved.calibration, steps=STEPS)
    residual = problem.scan_residual(problem.family.skin(fit.calibration, fit.effects))
    return 0.5 * float((residual[out] ** 2).sum())
