"""A made-up evaluation, complete enough to fill every part of a report."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ertskin.calibration.result import Calibration
from ertskin.evaluation.metrics import Score
from ertskin.evaluation.outcome import Outcome
from ertskin.evaluation.predictions import evaluate_outcome
from ertskin.evaluation.results import MethodResult, SeedResult
from ertskin.hardware.measurement import Frames, Recording
from ertskin.physics.history import History
from ertskin.physics.piezo.polynomial import PiezoPolynomial
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import Layer, Sensor, rectangle_m, taxel_grid_m
from ertskin.report.report import ReportInputs

TAXEL_M = taxel_grid_m((0.12, 0.12), 6, 6)


def sensor() -> Sensor:
    """Twenty-four pads round 36 taxels under one layer of foam."""
    angle = np.arange(24) * np.pi / 12
    centre_m = 0.06 + 0.05 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Sensor(
        rectangle_m((0.12, 0.12)),
        18e3,
        electrode_center_m=centre_m,
        electrode_size_m=np.full((24, 2), 0.004),
        taxel_m=TAXEL_M,
        layers=(Layer("neoprene", 4e-3, 28e3, 0.3), Layer("fabric", 5e-4, 344e3, 0.4)),
    )


def truth(rng: np.random.Generator) -> np.ndarray:
    """Eight forces on each taxel, then fourteen pairs of weights."""
    maps = np.zeros((302, 36))
    for frame in range(288):
        maps[frame, frame // 8] = 1.1 * (frame % 8) + 0.6
    for frame in range(288, 302):
        maps[frame, rng.choice(36, 2, replace=False)] = 4.9
    return maps


def outcome(seed: int, noise_n: float) -> Outcome:
    """A method's answers: light touches lost, forces off by ``noise_n``, a ghost now and then."""
    rng = np.random.default_rng(seed)
    maps = truth(np.random.default_rng(0))
    said = np.where(maps > 2 * noise_n * rng.random(maps.shape), maps + noise_n * rng.standard_normal(maps.shape), 0.0)
    said = np.maximum(said, 0.0)
    said[rng.random(302) < 0.2 * noise_n, 5] += 1.0
    return Outcome(maps, said, said > 0.2, TAXEL_M)


def method(name: str, kind: str, noise_n: float, seeds: int, note: str = "") -> MethodResult:
    """A method with ``seeds`` trainings."""
    outcomes = {seed: outcome(seed + 1, noise_n) for seed in range(seeds)}
    runs = tuple(SeedResult(seed, evaluate_outcome(answer), answer) for seed, answer in outcomes.items())
    return MethodResult(name, kind, runs, note)  # type: ignore[arg-type]


def methods() -> list[MethodResult]:
    """Networks, yardsticks and a bound."""
    bound = Score("force_rmse_one_n", 0.04, np.full(36, 0.04))
    return [
        method("reciprocal", "network", 0.1, 3, "276 numbers in, residual network"),
        method("paper's pipeline", "network", 0.6, 3, "denoiser, localization, force"),
        method("oracle", "yardstick", 0.05, 1, "maximum likelihood"),
        method("kernel ridge", "yardstick", 0.8, 3),
        method("ridge", "yardstick", 1.5, 1),
        MethodResult("Cramér-Rao bound", "bound", (SeedResult(0, {"force_rmse_one_n": bound}),)),
    ]


def recording() -> Recording:
    """Three presses on a skin of twenty-four electrodes."""
    rng = np.random.default_rng(1)
    phase = np.array(([0] * 2 + [1] * 6 + [2] * 2) * 3, dtype=np.uint8)
    force_n = np.where(phase == 0, 0.0, np.tile(np.linspace(0, 8, 10), 3))[:, None]
    frames = len(phase)
    place_m = np.where((phase == 0)[:, None], np.nan, np.repeat(TAXEL_M[[3, 17, 30]], 10, axis=0))[:, None]
    history = History(
        10 + 0.5 * np.arange(frames), np.repeat(np.arange(3), 10), phase, place_m, 4e-4 * force_n, force_n
    )
    protocol = Protocol.against_sink(electrode_pairs(24), 24, 1e-4)
    voltage_v = 1.0 + 0.02 * force_n[:, :, None] * rng.random((276, 24)) + 2e-3 * rng.standard_normal((frames, 276, 24))
    return Recording("example bench", "2026-01-01", "", sensor(), protocol, Frames(voltage_v.astype("f4"), history))


def inputs(calibration_figures: Path | None = None) -> ReportInputs:
    """A whole report's worth."""
    law = PiezoPolynomial.fit(*_law_points())
    calibration = Calibration("example.h5", sensor(), law, np.linspace(200, 900, 24), None, 12e3, 2e-3)
    return ReportInputs(
        "Example skin: calibration and evaluation",
        methods(),
        recordings={"training": recording(), "one-point test": recording()},
        calibration=calibration,
        calibration_figures=calibration_figures,
        footer=("made-up data",),
    )


def _law_points() -> tuple[np.ndarray, np.ndarray]:
    stress_pa = np.linspace(0, 1e5, 200)
    return stress_pa, 18e3 * np.exp(-stress_pa / 2e4) + 2e3
