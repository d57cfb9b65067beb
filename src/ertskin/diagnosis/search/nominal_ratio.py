"""The ratio of moduli kept near nominal while the first of what is missing is looked for.

Where a property varies between the few places pressed, a foam twelve times too soft fits better than one that is as its
data sheet says, and about that fit the field is another one: of a seam of sensitivity (``c035`` of ``twentyeighth48``)
the map followed the true one by 0.01 with the ratio at its bound, and frames held out were missed by 1.61 of the noise
instead of 1.31 without any map.
"""

from __future__ import annotations

from dataclasses import replace

from ertskin.diagnosis.fit.full_solution_check import CheckedFit, Problem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.linear.calibration_vector import WIDEST_RATIO
from ertskin.diagnosis.search.settling import where_it_settles

RUN_AWAY = 0.4
"""Part of the widest ratio of moduli from which on a fit is taken to have run away."""
NEAR = 0.4
"""How far the logarithm of the ratio may go near nominal: a foam half again as stiff as its data sheet says."""


def has_run_away(solved: Solved) -> bool:
    """Whether a fit's ratio of moduli is far from nominal."""
    return abs(solved.calibration.log_ratio) >= RUN_AWAY * WIDEST_RATIO


def at_nominal(solved: Solved) -> Solved:
    """The fit to be begun again with its ratio of moduli put back; all else is as it was with the old one."""
    return replace(solved, calibration=replace(solved.calibration, log_ratio=0.0))


def near_nominal(build: Problem) -> Problem:
    """What linearises, the ratio of moduli kept near nominal."""
    return lambda solved: replace(build(solved), widest_ratio=NEAR)


def let_go(build: Problem) -> Problem:
    """What linearises, the ratio as free as it is elsewhere."""
    return lambda solved: replace(build(solved), widest_ratio=WIDEST_RATIO)


def reconsidered(build: Problem, incumbent: CheckedFit) -> CheckedFit:
    """The fit begun again from the nominal ratio of moduli, where that fits better than a ratio far from it.

    A ratio that made up for a missing effect doesn't come back by itself once the effect is there.
    """
    solved = incumbent.solved
    if not has_run_away(solved):
        return incumbent
    again = incumbent.problem.solve(solved.terms, at_nominal(solved).calibration, leftover=solved.leftover)
    if again.cost >= solved.cost:
        return incumbent
    proposed = where_it_settles(build, incumbent.problem, again)
    return incumbent if proposed is None or proposed.spoils(incumbent) else proposed
