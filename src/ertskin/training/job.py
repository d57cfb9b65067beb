"""One training job: named by what it computes, tracked, skipped where it is done, gone on with where it was cut off."""

from __future__ import annotations

import json
import os
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import hydra
from omegaconf import DictConfig, OmegaConf

from ertskin.data.material import Material
from ertskin.data.shards import file_sha256
from ertskin.errors import UserError
from ertskin.evaluation.predictions import as_plain
from ertskin.models.reconstruction import Reconstruction
from ertskin.tracking.model import log_model
from ertskin.tracking.run import Run, finished_run
from ertskin.tracking.settings import TrackingSettings
from ertskin.tracking.sweep import job_key, parent_run_id
from ertskin.training.reconstruct import train_reconstruction
from ertskin.training.settings import TrainerSettings
from ertskin.training.validation import validate

DONE, MODEL = "done.json", "model.pt"
# What a job's outcome doesn't depend on: where things lie. What they hold is in the checksums.
ASIDE = ("tracking", "out", "cluster", "recording", "calibration")


@dataclass(frozen=True)
class Job:
    """A finished job: its folder, its MLflow run, the path of its model and the metrics of its validation."""

    folder: Path
    run_id: str
    model: Path
    metrics: dict[str, float]
    skipped: bool


def train_job(config: DictConfig, material: Material) -> Job:
    """Train ``config.model`` with ``config.trainer`` on ``material``, and track it."""
    request = cast(dict[str, Any], OmegaConf.to_container(config, resolve=True))
    checksums = {"data_checksum": material.checksum}
    if config.recording is not None:
        checksums["recording_checksum"] = file_sha256(Path(config.recording))
    key = job_key({name: value for name, value in request.items() if name not in ASIDE} | checksums)
    folder = Path(config.out) / key
    tracking = TrackingSettings.of(config.tracking)
    if done := _done(folder, tracking, key):
        return done
    folder.mkdir(parents=True, exist_ok=True)
    with Run.begin(tracking, key, _name(config), parent_run_id=parent_run_id()) as run:
        run.parameters(request | checksums)
        reconstruction = _train(config, material, folder, run)
        reconstruction.about |= {"config": request, "run_id": run.run_id}
        reconstruction.save(folder / MODEL)
        log_model(run, folder / MODEL)
        metrics = _validate(config, reconstruction, material, run)
    content = {"run_id": run.run_id, "metrics": metrics}
    aside = folder / f"{DONE}.part"
    aside.write_text(json.dumps(content, indent=1), encoding="utf-8")
    os.replace(aside, folder / DONE)
    return Job(folder, run.run_id, folder / MODEL, metrics, skipped=False)


def _train(config: DictConfig, material: Material, folder: Path, run: Run) -> Reconstruction:
    def log(stage: str, losses: dict[str, float], epoch: int) -> None:
        run.metrics({f"{stage}_{name}": value for name, value in losses.items()}, epoch)

    reconstruction, fitted = train_reconstruction(
        material,
        hydra.utils.instantiate(config.model.network),
        hydra.utils.instantiate(config.model.denoiser),
        _settings(config),
        folder,
        log,
    )
    for stage, outcome in fitted.items():
        # A table shows a metric's last value: this one must be the best.
        run.metrics({f"{stage}_best_loss": outcome.loss, f"{stage}_best_epoch": outcome.epoch})
    return reconstruction


def _validate(config: DictConfig, reconstruction: Reconstruction, material: Material, run: Run) -> dict[str, float]:
    outcome = validate(reconstruction, material, _settings(config))
    metrics = {f"validation_{name}": score.value for name, score in outcome.scores.items()}
    run.metrics(metrics)
    run.table(as_plain(outcome.scores), "validation/per_taxel.json")
    for name, figure in outcome.figures().items():
        run.figure(figure, f"validation/{name}")
    return metrics


def _settings(config: DictConfig) -> TrainerSettings:
    return TrainerSettings(**config.trainer, seed=config.seed)


def _done(folder: Path, tracking: TrackingSettings, key: str) -> Job | None:
    """The job where both its folder and the tracking database know it as finished."""
    if not ((folder / DONE).is_file() and (folder / MODEL).is_file()):
        return None
    content: dict[str, Any] = json.loads((folder / DONE).read_text(encoding="utf-8"))
    try:
        Reconstruction.load(folder / MODEL)
    except UserError as error:
        # Its checkpoints are of that version too: nothing of it can be gone on from.
        print(f"training anew: {error}", file=sys.stderr, flush=True)
        shutil.rmtree(folder)
        return None
    if finished_run(tracking, key) != content["run_id"]:
        return None
    return Job(folder, content["run_id"], folder / MODEL, content["metrics"], skipped=True)


def _name(config: DictConfig) -> str:
    return f"{config.model.name}-seed{config.seed}"
