"""Two other ways to choose effects from the same library: in-sample AIC, and a pass in the manner of LISDD.

Both take the place of ``ertskin.diagnosis.search.selection.select``: the same fits, other criteria.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as f_distribution

from ertskin.diagnosis.contract.claims import Rival
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.linear.calibration_vector import Calibration
from ertskin.diagnosis.search.candidates import Candidate, screen
from ertskin.diagnosis.search.chosen import Chosen, Selection

Report = Callable[[float | None, str], None]
Problem = Callable[[Solved | None], VoltageProblem]

MOST = 3
"""Terms that are looked for: as many as a recording of the suite hides at most, for time."""
TRIED = 4
FLAGGED_P = 1e-3
ACCEPTED_P = 0.01


def by_aic(
    build: Problem,
    fixed: Sequence[Term],
    begun: Sequence[tuple[Term, object]],
    start: Calibration,
    partitions: Sequence[Sequence[int]],
    report: Report,
) -> Selection:
    """Terms enter while Akaike's criterion falls on the very frames they are fitted to; nothing need be material.

    Confidence: the term's Akaike weight among those tried with it and none (Burnham and Anderson 2002, section 2.9).
    What no network explains counts in every fit: costs are of the same readings.
    """
    problem = build(None)
    before = current = problem.solve(fixed, start, leftover=True)
    chosen: list[Chosen] = []
    for turn in range(MOST):
        report(0.2 + 0.1 * turn, "AIC: looking for another term")
        current = problem.at_hand(current)
        found = [_joined(problem, current, c, True) for c in _one_of_each(screen(problem, current, partitions), TRIED)]
        best = min(found, key=_aic, default=current)
        if _aic(best) >= _aic(current):
            break
        rivals, weight = _rivals(best, found), _akaike_weight(best, [*found, current])
        chosen.append(Chosen(best.terms[-1], current.cost - best.cost, _alone(problem, current), rivals, weight))
        problem = build(best)
        current = problem.solve(best.terms, best.calibration, leftover=True)
    kept = tuple(replace(c, term=t) for c, t in zip(chosen, current.terms[len(fixed) :], strict=True))
    return Selection(before, current, kept, problem, ())


def by_lisdd(
    build: Problem,
    fixed: Sequence[Term],
    begun: Sequence[tuple[Term, object]],
    start: Calibration,
    partitions: Sequence[Sequence[int]],
    report: Report,
) -> Selection:
    """Locate, isolate, structure: after arXiv 2606.23215, on this library.

    The calibration is fitted to the cells that look clean, frames with too much residual energy are flagged, every
    effect of the library is fitted to half of the cells and judged on the other half by an F-test; one term at most.
    Confidence: 1 - the p-value of that test.
    """
    problem = build(None)
    whole = problem.solve(fixed, start)
    clean = _on(problem, _cleanest(whole))
    before = clean.solve(fixed, whole.calibration)
    energy = (problem.scan_residual(problem.family.skin(before.calibration, before.effects)) ** 2).sum(axis=1)
    width = problem.evidence.scan_v.shape[1]
    flagged = chi2.sf(energy, width) * len(energy) < FLAGGED_P
    report(0.4, f"LISDD: {int(flagged.sum())} of {len(energy)} frames flagged")
    if not flagged.any():
        return Selection(whole, whole, (), problem, ())
    even = [cell for cell in range(problem.cell_count) if cell % 2 == 0]
    half, other = _on(problem, even), _on(problem, [c for c in range(problem.cell_count) if c % 2])
    without = half.solve(fixed, whole.calibration)
    lost = _energy(other, without)
    trials = [
        _joined(half, without, c, c.term.effect.stage == "acquisition")
        for c in _one_of_each(screen(half, without, partitions), len(partitions) + 20)
    ]
    best = min(trials, key=lambda t: _energy(other, t), default=None)
    count = int((other.weight > 0).sum()) * width
    p_value = 1.0 if best is None else _f_test(lost, _energy(other, best), best, without, count)
    if best is None or p_value > ACCEPTED_P:
        return Selection(whole, whole, (), problem, ())
    problem = build(problem.solve(best.terms, best.calibration))
    after = problem.solve(best.terms, best.calibration)
    rivals = _rivals(best, trials)
    won = Chosen(after.terms[-1], whole.cost - after.cost, _alone(problem, whole), rivals, 1 - p_value)
    return Selection(whole, after, (won,), problem, ())


def _one_of_each(found: Sequence[Candidate], most: int) -> list[Candidate]:
    """The best candidate of each name, ``most`` names at most."""
    names = list(dict.fromkeys(c.name for c in found if np.isfinite(c.gain)))[:most]
    return [next(c for c in found if c.name == name) for name in names]


def _joined(problem: VoltageProblem, current: Solved, candidate: Candidate, leftover: bool) -> Solved:
    """The fit with the candidate from where of its starts it fits best."""
    fits = (
        problem.solve([*current.terms, term], current.calibration, steps=5, leftover=leftover)
        for term in (candidate.term, *candidate.others)
    )
    return min(fits, key=lambda fit: fit.cost)


def _rivals(best: Solved, found: Sequence[Solved]) -> tuple[Rival, ...]:
    """The other candidates, by what their criterion falls short of the best one's."""
    others = [one for one in found if one is not best]
    return tuple(Rival(one.terms[-1].effect, 0.5 * (_aic(one) - _aic(best))) for one in others)


def _aic(solved: Solved) -> float:
    return 2 * solved.cost + 2 * len(solved.fit.value)


def _akaike_weight(best: Solved, tried: Sequence[Solved]) -> float:
    return float(1 / np.exp(-0.5 * (np.array([_aic(one) for one in tried]) - _aic(best))).sum())


def _alone(problem: VoltageProblem, without: Solved) -> float:
    rows = problem.weight > 0
    return float(np.sqrt((without.scan_residual[rows] ** 2).mean()))


def _cleanest(solved: Solved) -> list[int]:
    """The half of the cells of frames with the least misfit."""
    cost = solved.fit.quadratic.cost[:-1]
    return np.argsort(cost)[: max(1, len(cost) // 2)].tolist()


def _on(problem: VoltageProblem, cells: Sequence[int]) -> VoltageProblem:
    """The same problem with the frames of these cells only."""
    weight = np.where(np.isin(problem.cells, cells), problem.weight, 0.0)
    return VoltageProblem(problem.evidence, problem.family, problem.linear, problem.specimen, problem.cells, weight)


def _energy(problem: VoltageProblem, solved: Solved) -> float:
    skin = problem.family.skin(solved.calibration, solved.effects)
    return float((problem.scan_residual(skin) ** 2).sum())


def _f_test(lost: float, left: float, larger: Solved, smaller: Solved, count: int) -> float:
    """Chance of so large a fall of the residual energy by the further parameters alone."""
    added = max(1, len(larger.fit.value) - len(smaller.fit.value))
    freedom = max(1, count - len(larger.fit.value))
    return float(f_distribution.sf(max(lost - left, 0.0) / added / (left / freedom), added, freedom))
