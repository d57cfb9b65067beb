"""Fits that hold where they have come to: the skin solved in full against the linearised one they were made with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ertskin.diagnosis.voltage_fit import Solved, VoltageProblem

Problem = Callable[[Solved | None], VoltageProblem]

FRAMES = 24
FAR = 0.5
"""Share of the misfit, or of the noise where that is more, by which linearised frames may be off."""
TURNS = 4


def settled(build: Problem, solved: Solved) -> tuple[VoltageProblem, Solved]:
    """Linearised about the fit and fitted again, until the fit stays where the linearised skin is the skin."""
    for _ in range(TURNS):
        problem = build(solved)
        solved = problem.solve(solved.terms, solved.calibration)
        if not strays(problem, solved):
            break
    return problem, solved


def strays(problem: VoltageProblem, solved: Solved) -> bool:
    """Whether the fit has gone where the linearised skin no longer is the skin: seen on a few frames solved in full."""
    among = np.flatnonzero(problem.weight > 0)
    rows = among[np.unique(np.linspace(0, len(among) - 1, FRAMES).astype(int))]
    linear, evidence = problem.linear, problem.evidence
    skin = problem.family.remeshed(solved.calibration, solved.effects)
    readings = skin.readings_v(linear.history, linear.force_n, linear.wanted[rows])
    whole = readings.reshape(len(rows), -1) @ evidence.protocol.orthonormal
    claimed = problem.acquisition.scans(problem.family.skin(solved.calibration, solved.effects))[rows]
    off = float(np.sqrt(np.mean(((claimed - whole) / evidence.noise_v) ** 2)))
    misfit = float(np.sqrt(np.mean(solved.scan_residual[rows] ** 2)))
    return off > FAR * max(1.0, misfit)
