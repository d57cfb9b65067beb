"""Fits that hold where they have come to: the skin solved in full against the linearised one they were made with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.layout import halfway
from ertskin.diagnosis.fit.levenberg_marquardt import Fit
from ertskin.diagnosis.fit.solved import Solved

Problem = Callable[[Solved | None], VoltageProblem]

FRAMES = 24
FAR = 0.25
"""Share of the misfit, or of the noise where that is more, by which linearised frames may be off."""
TURNS = 6
NEARER = 0.7
"""Factor by which a turn must bring the linearised skin nearer to the skin to have been a good one."""
BETTER = 0.98
"""Part of the least misfit so far below which a turn that goes halfway must come for another to be worth it."""

TINY = 1e-300
EXACT_TURNS = 3
UNMOVED = 1.0
"""Standard errors by which a turn may move a number and be the last one: where a turn moved one by 0.6 the next moved
it by 0.05 and 0.14 (``c026`` of ``eighth32``, ``known_piezo_hysteresis``)."""


@dataclass(frozen=True, eq=False)
class CheckedFit:
    """A fit and the problem it was made with. On a few frames solved in full: ``misfit`` of the fit and ``off``, by how
    much the linearised skin differs from the whole one, both rms over noise. ``freed`` is the same
    fit once more of it was freed and nothing held and was better."""

    problem: VoltageProblem
    solved: Solved
    misfit: float
    off: float
    freed: Solved | None = None

    @property
    def linearisation_fails(self) -> bool:
        """Whether the fit has gone where the linearised skin no longer is the skin."""
        claimed = float(np.sqrt(np.mean(self.solved.scan_residual[_sampled(self.problem)] ** 2)))
        return not self.off <= FAR * max(1.0, claimed)

    @property
    def holds(self) -> bool:
        """Whether to linearise about the fit would change nothing that counts."""
        return not self.linearisation_fails or self.linearised_about_itself

    @property
    def linearised_about_itself(self) -> bool:
        """Whether the skin is linearised within a standard error of the fit: about the fit it would be the same. The
        calibration's numbers count together, for those of the law's shape hardly matter one by one."""
        about = self.problem.about
        if about is None or not _of_one_form(about, self.solved):
            return False
        moved, first = _moved(about.fit.value, self.solved.fit), self.solved.first(0)
        return bool((moved[first:] <= UNMOVED).all() and np.mean(moved[:first] ** 2) <= UNMOVED**2)

    def spoils(self, other: CheckedFit) -> bool:
        """Whether frames solved in full fit worse than in the ``other``."""
        return not self.misfit <= self.problem.evidence.criteria.chance_ratio * other.misfit


def checked_fit(problem: VoltageProblem, solved: Solved) -> CheckedFit:
    """Solve a few of the frames in full."""
    rows, evidence = _sampled(problem), problem.evidence
    whole = problem.in_full(solved, rows)
    claimed = problem.scans(problem.family.skin(solved.calibration, solved.effects))[rows]
    off = float(np.sqrt(np.mean(((claimed - whole) / evidence.noise_v) ** 2)))
    sampled = evidence.frames(rows)
    wrong = sampled.discounted((sampled.scan_v - whole) / evidence.noise_v)
    return CheckedFit(problem, solved, float(np.sqrt(np.mean(wrong**2))), off)


def settled(build: Problem, solved: Solved) -> CheckedFit:
    """Linearised about the fit and fitted again, until the fit stays where the linearised skin is the skin.

    Where a turn brings the linearised skin no nearer to the skin the fit has gone too far: the next is linearised
    halfway. Where that fits hardly better than any turn before, none will, and it is the best of them. What presses
    have left behind elsewhere is to first order about rest wherever the skin is linearised: where that is what they
    differ by no further turn helps.
    """
    lasting = any(getattr(effect, "remembers_air", False) for effect in solved.effects)
    off, halved, best = np.inf, False, None
    for _ in range(TURNS):
        problem = build(solved)
        checked = checked_fit(problem, problem.solve(solved.terms, solved.calibration))
        if checked.holds:
            return checked
        helped = best is None or checked.misfit < BETTER * best.misfit
        best = checked if best is None else min(best, checked, key=lambda fit: fit.misfit)
        nearer = checked.off <= NEARER * off
        if not nearer and (lasting or (halved and not helped)):
            break
        halved, off = not nearer, min(off, checked.off)
        solved = halfway(solved, checked.solved) if halved else checked.solved
    return cast(CheckedFit, best)


def exact(problem: VoltageProblem, solved: Solved) -> tuple[VoltageProblem, Solved]:
    """The fit where every frame is solved in full, and the problem corrected to that.

    What linearising leaves is a part of the noise, but alike in all frames: along a valley of the misfit it carries a
    time constant off by several standard errors.
    """
    for _ in range(EXACT_TURNS):
        corrected = problem.corrected(solved)
        proposed = corrected.solve(solved.terms, solved.calibration)
        problem, moved, solved = corrected, _moved(solved.fit.value, proposed.fit), proposed
        if (moved <= UNMOVED).all():
            break
    return problem, solved


def _moved(value: NDArray[np.float64], fit: Fit) -> NDArray[np.float64]:
    """(n,) how far the numbers of a fit are from ``value`` (n,), in standard errors."""
    return np.asarray(np.abs(fit.value - value) / np.sqrt(np.maximum(np.diag(fit.covariance), TINY)))


def _of_one_form(one: Solved, other: Solved) -> bool:
    """Whether two fits differ in nothing but their numbers."""
    return len(one.terms) == len(other.terms) and all(
        a.free == b.free and a.modes is b.modes and a.at(b.start).effect == b.effect
        for a, b in zip(one.terms, other.terms, strict=True)
    )


def _sampled(problem: VoltageProblem) -> NDArray[np.intp]:
    among = np.flatnonzero(problem.weight > 0)
    return among[np.unique(np.linspace(0, len(among) - 1, FRAMES).astype(int))]
