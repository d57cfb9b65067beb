"""One evaluation: test recordings, trained networks and yardsticks in; scores, files, tracking and report out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from ertskin.calibration.ready import calibration_folder, ready_calibration
from ertskin.data.grid import spacing_m
from ertskin.data.material import Material
from ertskin.data.shards import file_sha256
from ertskin.data.simulated import recorded_discrepancy, rising, simulated, simulated_trials
from ertskin.data.skin_forward import SkinForward, skin_of
from ertskin.data.synthesis import Forward
from ertskin.data.touches import touches_of
from ertskin.errors import UserError
from ertskin.evaluation.benchmark import TestFrames, network_result
from ertskin.evaluation.corrected_forward import CorrectedForward
from ertskin.evaluation.panel import yardsticks
from ertskin.evaluation.results import MethodResult, write_results
from ertskin.evaluation.tracked import track
from ertskin.evaluation.trained import finished_models, given_models, grouped, on_grid
from ertskin.report.report import ReportInputs, write_report
from ertskin.tracking.run import source_commit
from ertskin.tracking.settings import TrackingSettings
from hardware.recording import Recording, read_recording
from physics.conduction.sheet import Solution

Say = Callable[[str], None]
ROLES = {"one": "one-point test", "two": "two-point test"}


@dataclass(frozen=True)
class Evaluation:
    """Every method's result in the order of the table, where the files are, and what a person should know."""

    methods: tuple[MethodResult, ...]
    report: Path
    results: Path
    remarks: tuple[str, ...] = ()


def evaluate(config: DictConfig, say: Say = lambda line: None) -> Evaluation:
    """Carry out ``conf/evaluate.yaml``; ``say`` gets a line before each step.

    Raises ``UserError`` where there is no test recording or no trained network for its taxels.
    """
    source, tracking = Path(config.recording), TrackingSettings.of(config.tracking)
    named = {role: Path(config[key]) for key, role in ROLES.items() if config[key] is not None}
    if not named:
        raise UserError("nothing to test on: give one=FILE (single presses), two=FILE (two weights), or both")
    recordings = {"training": read_recording(source)} | {role: read_recording(path) for role, path in named.items()}
    say("simulated trials")
    material = simulated(config)
    frames = _frames(recordings, material)
    found = finished_models(Path(config.trained), source) if config.models is None else None
    models = given_models(list(config.models), tracking) if found is None else found
    fitting = on_grid(models, material.taxel_m)
    if not fitting:
        raise UserError(f"none of {len(models)} models answers for the {len(material.taxel_m)} taxels of this grid")
    remarks = [] if len(fitting) == len(models) else [f"{len(models) - len(fitting)} models of other grids left out"]
    methods = []
    for name, trained in grouped(fitting).items():
        say(name)
        methods.append(network_result(name, trained, frames))
    methods.sort(key=_rank)
    forward, rest = _physics(config, recordings["training"], material)
    seeds = range(int(config.yardstick_seeds))
    methods += yardsticks(list(config.yardsticks), material, forward, rest, frames, seeds, say)
    say("report")
    out = Path(config.out) if config.out else Path("runs/evaluate") / source.stem
    about = _about(source, named, material)
    results, table = write_results(out, methods, about)
    report = write_report(out / "report.html", _inputs(config, source, recordings, methods, about))
    say("tracking")
    track(tracking, methods, [report, results, table], about)
    return Evaluation(tuple(methods), report, results, tuple(remarks))


def _frames(recordings: dict[str, Recording], material: Material) -> TestFrames:
    tests = [touches_of(recording) for role, recording in recordings.items() if role != "training"]
    if any(test.protocol.design.shape != material.protocol.design.shape for test in tests):
        raise UserError("a test recording was scanned with another protocol than the training recording")
    return TestFrames.of(tests, material.taxel_m, 0.5 * spacing_m(material.taxel_m))


def _physics(config: DictConfig, recording: Recording, material: Material) -> tuple[Forward, Callable[[], Solution]]:
    """The forward model behind the material, discrepancy included where it has one, and the sheet at rest."""
    forward = simulated_trials(config, recording).forward
    return _corrected(config, recording, material, forward), lambda: _at_rest(forward)


def _corrected(config: DictConfig, recording: Recording, material: Material, forward: SkinForward) -> Forward:
    if recording.frames is None or not config.data.discrepancy:
        return forward
    real = rising(touches_of(recording))
    if not len(real):
        return forward
    changes_ohm = forward.change_ohm(real.history.contact_m, real.history.force_n)
    return CorrectedForward(forward, recorded_discrepancy(material, real, changes_ohm), material.protocol)


def _at_rest(forward: SkinForward) -> Solution:
    skin = skin_of(forward.calibration, forward.protocol, {}, forward.resolution)
    sheet = skin.sheet
    return sheet.solve(sheet.uniform(skin.sensor.sheet_resistance_ohm_sq), skin.contact_resistance_ohm)


def _rank(method: MethodResult) -> tuple[float, float]:
    """Networks by hits on one point and two, then by force: the best first."""
    hits = sum(method.values(name).mean() for name in ("hit_rate_one", "exact_rate_two") if len(method.values(name)))
    errors = [method.values(name).mean() for name in ("force_rmse_one_n", "force_error_two_n")]
    return -hits, float(np.nansum(errors))


def _about(source: Path, named: dict[str, Path], material: Material) -> dict[str, object]:
    files = {"training": source} | named
    return {
        "files": {role: {"name": path.name, "sha256": file_sha256(path)} for role, path in files.items()},
        "data_checksum": material.checksum,
        "commit": source_commit(),
    }


def _inputs(
    config: DictConfig,
    source: Path,
    recordings: dict[str, Recording],
    methods: list[MethodResult],
    about: dict[str, object],
) -> ReportInputs:
    calibration, _ = ready_calibration(config, recordings["training"])
    given = config.calibration.file
    figures = calibration_folder(Path(config.calibration.folder), source) if given is None else Path(given).parent
    return ReportInputs(
        f"{recordings['training'].rig}: calibration and evaluation",
        methods,
        config.shown,
        recordings,
        calibration,
        figures,
        [f"{name}: {value}" for name, value in about.items()],
    )
