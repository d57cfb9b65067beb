"""One evaluation: test recordings, trained networks and yardsticks in; scores, files, tracking and report out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import DictConfig

from ertskin import __version__
from ertskin.calibration.ready import ready_calibration
from ertskin.data.grid import spacing_m
from ertskin.data.material import Material
from ertskin.data.shards import file_sha256
from ertskin.data.simulated import correcting, material_and_forward, recorded_discrepancy
from ertskin.data.skin_forward import SkinForward, skin_of
from ertskin.data.sources import calibration_path
from ertskin.data.synthesis import Forward
from ertskin.data.touches import Touches, touches_of
from ertskin.errors import UserError
from ertskin.evaluation.anywhere.evaluate import evaluate_anywhere, merged
from ertskin.evaluation.benchmark import TestFrames, network_result
from ertskin.evaluation.corrected_forward import CorrectedForward
from ertskin.evaluation.followed import seen_by
from ertskin.evaluation.grids import Grid, grids, on_points
from ertskin.evaluation.panel import yardsticks
from ertskin.evaluation.recordings import ANYWHERE_ROLE, EvaluatedRecordings
from ertskin.evaluation.results import MethodResult, metric_names, write_results
from ertskin.evaluation.tracked import track
from ertskin.evaluation.trained import finished_models, given_models, on_grid, without_and_with
from ertskin.hardware.recording import Recording
from ertskin.hardware.virtual.bench.sealing import SealError, committed, unseal
from ertskin.models.reconstruction import Reconstruction
from ertskin.physics.conduction.sheet import Solution
from ertskin.report.report import ReportInputs, write_report
from ertskin.tracking.datasets import DatasetInfo
from ertskin.tracking.run import source_commit
from ertskin.tracking.settings import TrackingSettings

Say = Callable[[str], None]
DIAGNOSIS = "diagnosis.json"


@dataclass(frozen=True)
class Evaluation:
    """Every method's result in the order of the table, where the files are, and what a person should know."""

    methods: tuple[MethodResult, ...]
    report: Path
    results: Path
    remarks: tuple[str, ...] = ()


def evaluate(config: DictConfig, files: EvaluatedRecordings, say: Say = lambda line: None) -> Evaluation:
    """Carry out ``conf/evaluate.yaml`` on ``files``; ``say`` gets a line before each step.

    Raises ``UserError`` where there is no trained network for the tests' taxels.
    """
    source, named, tracking = files.source, files.test_paths, TrackingSettings.of(config.tracking)
    story = Story.of(config)
    recordings = {"training": files.training} | files.tests
    found = finished_models(Path(config.trained), source) if config.models is None else None
    models = given_models(list(config.models), tracking) if found is None else found
    methods: list[MethodResult] = []
    remarks: list[str] = []
    checksums: dict[str, str] = {}
    on_taxels = {role: recording for role, recording in recordings.items() if role != ANYWHERE_ROLE}
    compared = grids(config, models, ready_calibration(config, files.training)[0].known_sensor)
    groups = {name: group for grid in compared for name, group in grid.groups.items()}
    for grid in compared if len(on_taxels) > 1 else ():
        judged, noted, checksums[grid.name] = _on_taxels(grid, on_taxels, say)
        methods, remarks = methods + judged, remarks + noted
    if ANYWHERE_ROLE in recordings:
        anywhere, more = evaluate_anywhere(config, files.training, recordings[ANYWHERE_ROLE], groups, say)
        methods, remarks = merged(methods, anywhere), remarks + more
    methods = _in_order(methods)
    say("report")
    out = Path(config.out) if config.out else Path("runs/evaluate") / f"{source.stem}{_grid(config)}"
    about = _about(source, named, checksums.get("") or checksums or None)
    results, table = write_results(out, methods, about)
    inputs = _inputs(config, source, recordings, methods, about)
    report = write_report(
        out / "report.html",
        replace(inputs, diagnosis=story.diagnosis, pairs=without_and_with(groups), hidden=story.hidden),
    )
    say("tracking")
    tests = [DatasetInfo(path.name, file_sha256(path), "test", path) for path in named.values()]
    track(tracking, methods, [report, results, table], about, tests)
    return Evaluation(tuple(methods), report, results, tuple(remarks))


@dataclass(frozen=True)
class Story:
    """What a report says besides the scores: the folder of the recording's diagnosis, and what its seal held."""

    diagnosis: Path | None
    hidden: tuple[dict[str, dict[str, Any]], str] | None

    @classmethod
    def of(cls, config: DictConfig) -> Story:
        """As ``config.diagnosis`` and ``config.sealed`` name them; ``UserError`` where either isn't there."""
        diagnosis = None if config.diagnosis is None else Path(config.diagnosis)
        if diagnosis is not None and not (diagnosis / DIAGNOSIS).is_file():
            raise UserError(f"{diagnosis}: no {DIAGNOSIS} in it; name the folder that ertskin diagnose wrote into")
        if config.sealed is None:
            return cls(diagnosis, None)
        try:
            truth, _ = unseal(Path(config.recording), Path(config.sealed))
        except SealError as error:
            raise UserError(str(error)) from None
        hidden = {name: dict(effect["parameters"]) for name, effect in truth.effects.items()}
        return cls(diagnosis, (hidden, committed(Path(config.recording))))


def _on_taxels(grid: Grid, recordings: dict[str, Recording], say: Say) -> tuple[list[MethodResult], list[str], str]:
    """Networks of this grid and yardsticks on presses of its points, what a person should know, and the data's
    checksum."""
    config, groups = grid.config, grid.groups
    say(f"simulated trials {grid.name}".rstrip())
    material, simulation = material_and_forward(config, recordings["training"])
    tests = [recording for role, recording in recordings.items() if role != "training"]
    zeroed = [touches_of(recording) for recording in tests]
    frames = _frames(zeroed, material, grid.name)
    fitting = {name: on_grid(trained, material.taxel_m) for name, trained in groups.items()}
    count = sum(map(len, groups.values()))
    if not any(fitting.values()):
        raise UserError(f"none of {count} models answers for the {len(material.taxel_m)} taxels of this grid")
    left_out = count - sum(map(len, fitting.values()))
    remarks = [f"{left_out} models of other grids left out: grids=[3x3,6x6] shows grids side by side"] * (left_out > 0)
    if grid.name:
        remarks.append(f"grid {grid.name}: judged on {len(frames.change_v)} of {sum(map(len, zeroed))} test frames")
    methods = []

    def as_seen(one: Reconstruction) -> TestFrames:
        seen = [seen_by(one, *pair, bool(config.follow)) for pair in zip(tests, zeroed, strict=True)]
        remarks.extend(line for _, lines in seen for line in lines if line not in remarks)
        return _frames([touches for touches, _ in seen], material, grid.name)

    for name, trained in fitting.items():
        if trained:
            say(name)
            methods.append(network_result(name, trained, as_seen))
    forward = _corrected(config, recordings["training"], material, simulation)
    seeds = range(int(config.yardstick_seeds))
    yardstick_results = yardsticks(
        list(config.yardsticks), material, forward, lambda: _at_rest(simulation), frames, seeds, say
    )
    methods += [replace(method, name=f"{method.name} {grid.name}".rstrip()) for method in yardstick_results]
    return [replace(method, grid=grid.name) for method in methods], remarks, material.checksum


def _grid(config: DictConfig) -> str:
    """What tells the reports of different grids apart; nothing for the recording's own taxels."""
    if config.grids is not None:
        return "".join(f"-{name}" for name in config.grids)
    return "" if config.grid.columns is None else f"-{config.grid.columns}x{config.grid.rows}"


def _frames(tests: Sequence[Touches], material: Material, grid: str) -> TestFrames:
    """Of one grid among several the frames on its points; the only one must have all on them."""
    if any(test.protocol.design.shape != material.protocol.design.shape for test in tests):
        raise UserError("a test recording was scanned with another protocol than the training recording")
    within_m = 0.5 * spacing_m(material.taxel_m)
    if grid:
        tests = [on_points(test, material.taxel_m, within_m) for test in tests]
        if not any(map(len, tests)):
            raise UserError(f"grids: no test frame has its contacts on the points of {grid}")
    return TestFrames.of(tests, material.taxel_m, within_m)


def _corrected(config: DictConfig, recording: Recording, material: Material, forward: SkinForward) -> Forward:
    """The forward model behind the material, discrepancy included where it has one."""
    if recording.frames is None or not config.data.discrepancy:
        return forward
    real = correcting(touches_of(recording))
    if not len(real):
        return forward
    changes_ohm = forward.change_ohm(real.history.contact_m, real.history.force_n)
    return CorrectedForward(forward, recorded_discrepancy(material, real, changes_ohm), material.protocol)


def _at_rest(forward: SkinForward) -> Solution:
    """The sheet at rest."""
    skin = skin_of(forward.calibration, forward.protocol, {}, forward.resolution)
    sheet = skin.sheet
    return sheet.solve(sheet.uniform(skin.sensor.sheet_resistance_ohm_sq), skin.contact_resistance_ohm)


def _in_order(methods: Sequence[MethodResult]) -> list[MethodResult]:
    """Networks, the best first, then the yardsticks as they are."""
    networks = sorted((method for method in methods if method.kind == "network"), key=_rank)
    return networks + [method for method in methods if method.kind != "network"]


def _rank(method: MethodResult) -> tuple[float, float]:
    """By right answers in all tests, on the taxels and anywhere, then by force."""
    means = {name: float(method.values(name).mean()) for name in metric_names([method])}
    right = [mean for name, mean in means.items() if name.startswith(("hit_rate", "exact_rate", "count_rate"))]
    errors = [mean for name, mean in means.items() if name.startswith(("force_rmse", "force_error"))]
    return -float(np.mean(right)), float(np.mean(errors))


def _about(source: Path, named: dict[str, Path], checksum: str | dict[str, str] | None) -> dict[str, Any]:
    files = {"training": source} | named
    return {
        "files": {role: {"name": path.name, "sha256": file_sha256(path)} for role, path in files.items()},
        "data_checksum": checksum,
        "commit": source_commit(),
    }


def _inputs(
    config: DictConfig,
    source: Path,
    recordings: dict[str, Recording],
    methods: list[MethodResult],
    about: dict[str, Any],
) -> ReportInputs:
    calibration, _ = ready_calibration(config, recordings["training"])
    figures = calibration_path(config).parent
    return ReportInputs(
        f"Evaluation on {source.name}",
        methods,
        config.shown,
        recordings,
        calibration,
        figures,
        _footer(about),
    )


def _footer(about: dict[str, Any]) -> list[str]:
    """How the numbers came about, in lines for the foot of a page; ``evaluation.json`` has the checksums whole."""
    files = [f"{role}: {file['name']} ({file['sha256'][:12]})" for role, file in about["files"].items()]
    checksum = about["data_checksum"]
    grids = checksum if isinstance(checksum, dict) else {"": checksum}
    trials = [f"simulated trials {grid}".rstrip() + f": {known[:12]}" for grid, known in grids.items() if known]
    return [*files, *trials, f"ertskin {__version__}, commit {about['commit'] or 'unknown'}"]
