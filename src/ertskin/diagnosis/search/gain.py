"""What one fit gains over another: on cells held out, and by evidence where those can't tell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.fit.cells_held_out import held_out
from ertskin.diagnosis.fit.solved import Solved


def gained(without: Solved, present: Solved, partitions: Sequence[Sequence[int]], criteria: Criteria) -> float:
    """Half chi-square that ``present`` gains over ``without``, held out.

    A press that no other tells of (the only one on a hill) is predicted wildly by either: in no cell may a prediction
    gain or lose more than the fit itself, and all of them no more than that less what its freedom costs: a smooth field
    predicts what any sharp cause does to the presses at hand, a displaced pad, say, as well as that cause does. What
    explains most of the misfit gains just that, however badly the cells predict one another with it: that isn't owed to
    too free a form. Cells can't predict a field told place by place, which gains its evidence.
    """
    fitted_gain = np.array([_cost(without, out) - _cost(present, out) for out in partitions])
    predicted = held_out(without, partitions) - held_out(present, partitions)
    gain = float(np.clip(predicted, -np.abs(fitted_gain), np.abs(fitted_gain)).clip(max=fitted_gain).sum())
    before, after = (float(solved.fit.quadratic.cost[:-1].sum()) for solved in (without, present))
    evidence = before - after - freedom(present) + freedom(without)
    unpredictable = _by_place(present) > _by_place(without)
    return evidence if unpredictable or after < (1 - criteria.most_share) * before else min(gain, evidence)


def _by_place(solved: Solved) -> int:
    return sum(term.by_place for term in solved.terms)


def freedom(solved: Solved) -> float:
    """What the smooth fields of a fit cost in evidence: how much narrower they became, how far they went."""
    fields = np.zeros(len(solved.fit.value), dtype=bool)
    cost = 0.0
    for number, term in enumerate(solved.terms):
        fields[solved.sizes(number)] = True
        cost += 0.5 * float(np.square(term.sizes).sum())
    if not fields.any():
        return 0.0
    whole = solved.fit.quadratic.hessian.sum(axis=0) + solved.fit.prior
    return cost + 0.5 * (_log_determinant(whole) - _log_determinant(whole[np.ix_(~fields, ~fields)]))


def _cost(solved: Solved, cells: Sequence[int]) -> float:
    return float(solved.fit.quadratic.cost[list(cells)].sum())


def _log_determinant(matrix: np.ndarray) -> float:
    """Of a positive matrix; directions that nothing tells of count as the least determined one."""
    size = np.linalg.eigvalsh(matrix)
    return float(np.log(np.maximum(size, 1e-12 * size[-1])).sum())
