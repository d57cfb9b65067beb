"""How well cells held out are predicted: one Newton step on all the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.bounded_step import Region, bounded_step
from ertskin.diagnosis.fit.quadratic import LocalModel, Quadratic
from ertskin.diagnosis.fit.solved import LEAST_DAMPING, Solved

Array = NDArray[np.float64]

REACH = 5.0
"""Times what is typical of a parameter: as far as a quadratic about the fit can be believed."""
SCALED = 0.7
"""The same for parameters that are always positive, over their value."""


def held_out(solved: Solved, partitions: Sequence[Sequence[int]]) -> Array:
    """(len(partitions),) half chi-square of each held-out set of cells after one Newton step on all the others.

    None is predicted better than it is fitted: a step promises too much where the fit has not come to rest. Where such
    a step would take a term beyond ``REACH``, the other cells don't tell it (a spot that one press alone has met): as
    far as they don't, it is taken not to be there.
    """
    quadratic = solved.fit.quadratic
    cells = np.arange(len(quadratic.cost))
    result = np.zeros(len(partitions))
    numbers = _numbers(solved)
    for k, out in enumerate(partitions):
        inside = ~np.isin(cells, out)
        others = Quadratic(quadratic.cost[inside], quadratic.gradient[inside], quadratic.hessian[inside])
        step = _step(solved, LocalModel.of(others, solved.fit.prior, solved.fit.from_prior), numbers)
        for cell in out:
            change = -quadratic.gradient[cell] @ step + 0.5 * step @ quadratic.hessian[cell] @ step
            result[k] += quadratic.cost[cell] + max(change, 0.0)
    return result


@dataclass(frozen=True, eq=False)
class _Numbers:
    """A term's numbers (n,) in the vector of a fit: how far they may step, and the steps to where it is absent."""

    index: NDArray[np.intp]
    reach: Array
    away: Array


def _numbers(solved: Solved) -> list[_Numbers]:
    found = []
    for k, term in enumerate(solved.terms):
        known = [term.effect.known(key) for key in term.free]
        value = np.array([term.effect.value(key) for key in term.free])
        away = np.where([p.defining for p in known], np.array([p.neutral for p in known]) - value, 0.0)
        # A time constant is known by its logarithm rather, whatever is typical.
        scale = np.where([p.low > 0 for p in known], SCALED * value, 0.0)
        reach = np.maximum(REACH * np.array([p.typical for p in known]), scale)
        # One of several of a kind that the other cells don't tell says nothing of the others.
        single = np.array(["[" in key for key in term.free], dtype=bool)
        for which in (np.flatnonzero(~single), *np.flatnonzero(single)[:, None]):
            if len(which):
                found.append(_Numbers(solved.first(k) + which, reach[which], away[which]))
    return found


def _step(solved: Solved, model: LocalModel, numbers: Sequence[_Numbers]) -> Array:
    """The Newton step within the region that was fitted in: one that leaves it isn't one that a fit could take.

    Terms that would go beyond their reach, or that a bound alone keeps from it, are expected beforehand to be absent,
    give or take that reach; those that would go beyond it even so are taken away.
    """
    expected: list[_Numbers] = []
    held: list[_Numbers] = []
    value, region = solved.fit.value, solved.fit.region or Region.everywhere(len(solved.fit.value))
    slope, curvature = model.slope.copy(), model.curvature.copy()
    low, high = region.low.copy(), region.high.copy()
    while True:
        for term in held:
            low[term.index] = high[term.index] = value[term.index] + term.away
        within = replace(region, low=low, high=high)
        step = bounded_step(LocalModel(slope, curvature), value, within, LEAST_DAMPING)
        stopped = np.isclose(value + step, low) | np.isclose(value + step, high)
        wild = [t for t in numbers if t not in held and _is_wild(t, step, stopped, curvature.diagonal())]
        if not wild:
            return step
        held += [term for term in wild if term in expected]
        for term in wild:
            if term not in expected:
                curvature[term.index, term.index] += term.reach**-2
                slope[term.index] += term.away * term.reach**-2
                expected.append(term)


def _is_wild(term: _Numbers, step: Array, stopped: NDArray[np.bool_], curvature: Array) -> bool:
    """Whether a step (n,) says nothing of a term: it goes beyond its reach, or is ``stopped`` (n,) by a bound though it
    is known to no such reach by its ``curvature`` (n,)."""
    undetermined = stopped[term.index] & (curvature[term.index] * term.reach**2 < 1)
    return bool((undetermined | (np.abs(step[term.index]) > term.reach)).any())
