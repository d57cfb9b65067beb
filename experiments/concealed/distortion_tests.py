"""Many distortions tested at once, after Anau Montel, Alvey and Weniger, Phys. Rev. D 111 (2025) 083013.

The simulator is calibrated once. Every start of every effect is a distortion of it, tested by the likelihood ratio of
its columns beside those of the calibration: to first order this is exact, and nothing is fitted again. How small the
least p-value of so many tests becomes by chance is found by drawing noise: a test's global p-value is the share of the
draws in which any test has one as small. There is no "none of these", and no distortion takes anything from another.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from dictionary import Atom, Dictionary, dictionaries
from numpy.typing import NDArray
from scipy.stats import chi2

from ertskin.diagnosis.fit.full_solution_check import exact, settled
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.linear.calibration_vector import Calibration
from ertskin.diagnosis.search.chosen import Chosen, Selection
from ertskin.physics.conduction.mesh import MeshError

Array = NDArray[np.float64]
Report = Callable[[float | None, str], None]
Problem = Callable[[Solved | None], VoltageProblem]

LEVEL = 0.01
"""Global p-value up to which a distortion is named."""
DRAWS = 500
SEED = 0


@dataclass(frozen=True, eq=False)
class Tested:
    """A distortion, its amounts (c,) alone, the chi-square it takes off, and its p-value among all tests."""

    atom: Atom
    amount: Array
    fall: float
    p_value: float


def by_distortion_tests(
    build: Problem,
    fixed: Sequence[Term],
    begun: Sequence[tuple[Term, object]],
    start: Calibration,
    partitions: Sequence[Sequence[int]],
    report: Report,
) -> Selection:
    """Names the likeliest distortion of each name that is significant at ``LEVEL``; confidence: 1 - its global p-value.

    ``DRAWS`` draws allow 1 - 1/501 at most. What is named is fitted together once, after it is named, for the presses
    held out to judge.
    """
    checked = settled(build, build(None).solve(fixed, start))
    problem, before = exact(checked.problem, checked.solved)
    report(0.3, "testing all distortions")
    named = significant(outcomes(dictionaries(problem, before), DRAWS), LEVEL)
    report(0.6, f"{len(named)} names significant")
    if not named:
        return Selection(before, before, (), problem, ())
    after = _together(problem, before, named)
    numbers = np.count_nonzero(before.scan_residual)
    terms = after.terms[len(before.terms) :]
    chosen = tuple(
        Chosen(term, 0.5 * one.fall, float(np.sqrt(1 + one.fall / numbers)), (), 1 - one.p_value)
        for term, one in zip(terms, named, strict=True)
    )
    return Selection(before, after, chosen, problem, ())


def outcomes(found: Sequence[Dictionary], draws: int) -> list[Tested]:
    """Every atom of some independent dictionaries, tested against ``draws`` draws of noise over all of them."""
    rng = np.random.default_rng(SEED)
    falls, chances = zip(*(_falls_and_chances(one, draws, rng) for one in found), strict=True)
    # The logarithms of the p-values, the recording's first: however small, they stay apart.
    chance = np.concatenate(chances, axis=1)
    least = chance[1:].min(axis=1)
    p_values = (1 + (least[:, None] <= chance[0]).sum(axis=0)) / (1 + draws)
    fall = np.concatenate(falls)
    atoms = [(atom, one, k) for one in found for k, atom in enumerate(one.atoms)]
    return [
        Tested(atom, one.amount(k), float(fall[number]), float(p_values[number]))
        for number, (atom, one, k) in enumerate(atoms)
    ]


def _falls_and_chances(one: Dictionary, draws: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """(A,) chi-square that atoms take off the recording, and (1+D,A) logarithms of p-values there and in draws.

    White noise of unit size along columns left of the calibration has their Gram matrix for its covariance.
    """
    size, vector = np.linalg.eigh(one.reduced_gram)
    noise = rng.standard_normal((draws, len(size))) * np.sqrt(np.maximum(size, 0.0)) @ vector.T
    falls, ranks = one.falls(np.vstack([one.reduced_gradient, noise]))
    chances = np.where(ranks > 0, chi2.logsf(falls, np.maximum(ranks, 1)), 0.0)
    return falls[0], chances


def significant(found: Sequence[Tested], level: float) -> list[Tested]:
    """Of each name the distortion that takes off most, of those at this level; the largest first."""
    ordered = sorted((one for one in found if one.p_value <= level), key=lambda one: -one.fall)
    first: dict[str, Tested] = {}
    for one in ordered:
        first.setdefault(one.atom.effect.name, one)
    return list(first.values())


def _together(problem: VoltageProblem, before: Solved, named: Sequence[Tested]) -> Solved:
    """All that is named in one fit; where no sheet is like that, named but none of it in the simulator."""
    begun = [one.atom.term(one.amount).nearer(1 / len(named)) for one in named]
    leftover = any(one.atom.instrument for one in named)
    try:
        after = problem.solve([*before.terms, *begun], before.calibration, leftover=leftover)
        problem.family.remeshed(after.calibration, after.effects)
    except (MeshError, np.linalg.LinAlgError):
        none = [term.nearer(0.0) for term in begun]
        after = problem.solve([*before.terms, *none], before.calibration, steps=0, leftover=leftover)
    return after
