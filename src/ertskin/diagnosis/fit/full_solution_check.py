"""Fits that hold where they have come to: the skin solved in full against the linearised one they were made with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.joint_fit import Solved, VoltageProblem

Problem = Callable[[Solved | None], VoltageProblem]

FRAMES = 24
FAR = 0.25
"""Share of the misfit, or of the noise where that is more, by which linearised frames may be off."""
TURNS = 6
NEARER = 0.7
"""Factor by which a turn must bring the linearised skin nearer to the skin for another to be worth it."""

EXACT_TURNS = 3
UNMOVED = 1.0
"""Standard errors by which a turn may move a number and be the last one: where a turn moved one by 0.6 the next moved
it by 0.05 and 0.14 (``c026`` of ``eighth32``, ``known_piezo_hysteresis``)."""


@dataclass(frozen=True, eq=False)
class CheckedFit:
    """A fit and the problem it was made with. On a few frames solved in full: ``misfit`` of the fit and ``off``, by how
    much the linearised skin differs from the whole one, both rms over noise."""

    problem: VoltageProblem
    solved: Solved
    misfit: float
    off: float

    @property
    def linearisation_fails(self) -> bool:
        """Whether the fit has gone where the linearised skin no longer is the skin."""
        claimed = float(np.sqrt(np.mean(self.solved.scan_residual[_sampled(self.problem)] ** 2)))
        return not self.off <= FAR * max(1.0, claimed)

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

    What presses have left behind elsewhere is to first order about rest wherever the skin is linearised: where that
    is what they differ by, no further turn helps.
    """
    off = np.inf
    lasting = any(getattr(effect, "remembers_air", False) for effect in solved.effects)
    for _ in range(TURNS):
        problem = build(solved)
        solved = problem.solve(solved.terms, solved.calibration)
        checked = checked_fit(problem, solved)
        if not checked.linearisation_fails or (lasting and checked.off > NEARER * off):
            break
        off = checked.off
    return checked


def exact(problem: VoltageProblem, solved: Solved) -> tuple[VoltageProblem, Solved]:
    """The fit where every frame is solved in full, and the problem corrected to that.

    What linearising leaves is a part of the noise, but alike in all frames: along a valley of the misfit it carries a
    time constant off by several standard errors.
    """
    for _ in range(EXACT_TURNS):
        corrected = problem.corrected(solved)
        proposed = corrected.solve(solved.terms, solved.calibration)
        moved = np.abs(proposed.fit.value - solved.fit.value)
        problem, solved = corrected, proposed
        if (moved <= UNMOVED * np.sqrt(np.diag(solved.fit.covariance))).all():
            break
    return problem, solved


def _sampled(problem: VoltageProblem) -> NDArray[np.intp]:
    among = np.flatnonzero(problem.weight > 0)
    return among[np.unique(np.linspace(0, len(among) - 1, FRAMES).astype(int))]
