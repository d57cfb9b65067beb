"""Orthogonal matching pursuit over the library of effects, its length by cross-validation (arXiv 2509.16040).

At each step the effect enters whose columns correlate most with the residual, and all are fitted together again. The
correlation is that of what the fit so far leaves of the columns, for the calibration explains most of many an effect's.
Fits are the diagnosis's own: effects aren't linear in their parameters, and each is a group of columns, so a library's
pursuit over single columns isn't of use.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from dictionary import dictionaries
from numpy.typing import NDArray
from selectors_of_effects import MOST

from ertskin.diagnosis.fit.full_solution_check import CheckedFit, exact, settled
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.linear.calibration_vector import Calibration
from ertskin.diagnosis.search.chosen import Chosen, Selection
from ertskin.physics.conduction.mesh import MeshError

Array = NDArray[np.float64]
Report = Callable[[float | None, str], None]
Problem = Callable[[Solved | None], VoltageProblem]

BEGUN = 1.0, 0.3, 0.1
"""Of the amount found to first order, at which an effect is begun."""
STEPS = 6
"""Of the fits without a fold, which begin at the fit of all."""


def by_matching_pursuit(
    build: Problem,
    fixed: Sequence[Term],
    begun: Sequence[tuple[Term, object]],
    start: Calibration,
    partitions: Sequence[Sequence[int]],
    report: Report,
) -> Selection:
    """As many terms, in the order in which they enter, as predict presses left out best.

    Confidence of a term: the share of the folds, each some of the presses, whose error falls as it enters.
    """
    path = [settled(build, build(None).solve(fixed, start))]
    for turn in range(MOST):
        report(0.2 + 0.1 * turn, f"pursuit: term {turn + 1}")
        proposed = _one_more(build, path[-1])
        if proposed is None:
            break
        path.append(proposed)
    # Solved in full, each about its own fit: what linearising leaves would be as large as what a term gains.
    fits = [exact(checked.problem, checked.solved) for checked in path]
    errors = np.array([[error_without(*fit, out) for out in partitions] for fit in fits])
    best = int(errors.sum(axis=1).argmin())
    fallen = (errors[1:] < errors[:-1]).mean(axis=1)
    solved = [fit for _, fit in fits]
    terms = solved[best].terms[len(solved[0].terms) :]
    chosen = tuple(_chosen(term, solved[k], solved[k + 1], float(fallen[k])) for k, term in enumerate(terms))
    return Selection(solved[0], solved[best], chosen, fits[best][0], ())


def _one_more(build: Problem, incumbent: CheckedFit) -> CheckedFit | None:
    """With the effect more whose columns correlate most with the residual; None where there is none, or no sheet."""
    problem, current = incumbent.problem, incumbent.problem.at_hand(incumbent.solved)
    found = [
        (one.share * fall, one, k)
        for one in dictionaries(problem, current)
        for k, fall in enumerate(one.falls(one.reduced_gradient[None])[0][0])
    ]
    most, one, number = max(found, key=lambda each: each[0], default=(0.0, None, 0))
    if one is None or most <= 0:
        return None
    atom, term = one.atoms[number], one.atoms[number].term(one.amount(number))
    leftover = current.leftover or atom.instrument
    try:
        for share in BEGUN:
            terms = [*current.terms, term.nearer(share)]
            joined = problem.solve(terms, current.calibration, leftover=leftover)
            if joined.fit.quadratic.cost[:-1].sum() <= current.fit.quadratic.cost[:-1].sum():
                break
        return settled(build, joined)
    except (MeshError, np.linalg.LinAlgError):
        return None


def error_without(problem: VoltageProblem, solved: Solved, out: Sequence[int]) -> float:
    """Chi-square of the presses ``out``, readings that no network gives among it, by the terms fitted to the others."""
    held = np.isin(problem.cells, out)
    inside, outside = (replace(problem, weight=np.where(rows, problem.weight, 0.0)) for rows in (~held, held))
    fit = inside.solve(solved.terms, solved.calibration, steps=STEPS, leftover=solved.leftover)
    skin = problem.family.skin(fit.calibration, fit.effects)
    error = float((outside.scan_residual(skin) ** 2).sum())
    if problem.evidence.protocol.count > problem.evidence.protocol.orthonormal.shape[1]:
        error += outside.leftover_share * float((outside.acquisition.residual(skin) ** 2).sum())
    return error


def _chosen(term: Term, without: Solved, present: Solved, confidence: float) -> Chosen:
    """A term with what the residual fell by when it entered."""
    fallen = float((without.scan_residual**2).sum() - (present.scan_residual**2).sum())
    alone = float(np.sqrt(1 + max(fallen, 0.0) / max(1, int(np.count_nonzero(without.scan_residual)))))
    return Chosen(term, 0.5 * fallen, alone, (), confidence)
