"""24 contact resistances from an unloaded scan: Gauss-Newton against the paper's direct search."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from sheets import padded_sheet
from stopwatch import Stopwatch
from trials import NOISE_V, PROTOCOL

from ertskin.physics.calibration.contact_resistance import ContactProblem, direct_search, gauss_newton
from ertskin.physics.conduction.sheet import SheetModel

Result = TypeVar("Result")
GUESS_OHM = 300.0
SAME = 0.05
"""Two optima are one if no resistance differs by more of its standard error."""


def run(resolution: str, turns: int) -> dict:
    """Seconds of both on one thread and one noisy scan; raises ``AssertionError`` where the optima differ."""
    rng = np.random.default_rng(0)
    model = SheetModel(padded_sheet(), resolution)
    truth_ohm = np.exp(rng.uniform(np.log(100.0), np.log(1000.0), model.electrodes))
    sheet_ohm = padded_sheet().sheet_resistance_ohm_sq
    exact_v = PROTOCOL.readings(model.solve(model.uniform(sheet_ohm), truth_ohm).pair_resistance_ohm)
    scan_v = exact_v + rng.normal(0.0, NOISE_V, exact_v.shape)
    problem = ContactProblem(model, PROTOCOL, scan_v, sheet_ohm, GUESS_OHM)
    gauss_newton(problem)
    newton = sorted((_timed(gauss_newton, problem) for _ in range(turns)), key=lambda each: each[1].wall_s)[turns // 2]
    search = _timed(direct_search, problem)
    uniform = model.uniform(sheet_ohm)
    solving = sorted(_timed(lambda _: model.solve(uniform, truth_ohm), problem)[1].cpu_s for _ in range(turns))
    gap = np.abs(search[0].contact_resistance_ohm - newton[0].contact_resistance_ohm) / newton[0].standard_error_ohm
    if gap.max() > SAME:
        raise AssertionError(f"the optima differ by {gap.max():.2f} standard errors")
    return {
        "unknowns": model.space.nodes,
        "gauss_newton_s": newton[1].wall_s,
        "gauss_newton_solutions": newton[0].evaluations,
        "direct_search_s": search[1].wall_s,
        "direct_search_solutions": search[0].evaluations,
        "ratio_cpu": search[1].cpu_s / newton[1].cpu_s,
        "ratio_without_reduction": search[0].evaluations * solving[turns // 2] / newton[1].cpu_s,
        "gap_standard_errors": float(gap.max()),
        "load": os.getloadavg()[0],
    }


def _timed(method: Callable[[ContactProblem], Result], problem: ContactProblem) -> tuple[Result, Stopwatch]:
    with Stopwatch() as watch:
        fit = method(problem)
    return fit, watch
