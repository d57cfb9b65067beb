"""One training job: tracked, gone on with where it was cut off."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

import hydra
import numpy as np
from numpy.typing import NDArray
from omegaconf import DictConfig

from ertskin.data.material import Material
from ertskin.evaluation.predictions import as_builtins
from ertskin.files import write_whole
from ertskin.hardware.recording import read_recording
from ertskin.models.reconstruction import Reconstruction
from ertskin.settings import check_arguments
from ertskin.tracking.datasets import DatasetInfo
from ertskin.tracking.model import log_model
from ertskin.tracking.run import Run
from ertskin.tracking.settings import TrackingSettings
from ertskin.tracking.sweep import parent_run_id
from ertskin.training.commission import commissioned
from ertskin.training.finished import MODEL, Job
from ertskin.training.reconstruct import train_reconstruction
from ertskin.training.request import Request, job_name
from ertskin.training.settings import TrainerSettings, trainer_settings
from ertskin.training.start import check_start, starting
from ertskin.training.validation import Validation, validate

BEGUN = "begun.json"


def train_job(config: DictConfig, request: Request) -> Job:
    """Make the data, train ``config.model`` with ``config.trainer`` on them, and track it."""
    parts = built(config.model)
    start, settings = starting(config, trainer_settings(config.trainer, config.seed))
    if start is not None:
        protocol = None if config.recording is None else read_recording(config.recording).protocol
        check_start(start, parts["network"].func, parts["denoiser"] is not None, settings.max_epochs, protocol)
    material: Material = hydra.utils.instantiate(config.data.source)(config)
    folder = request.folder
    _begin(folder, material.checksum)
    with Run.begin(
        TrackingSettings.of(config.tracking), request.key, job_name(config), parent_run_id=parent_run_id()
    ) as run:
        run.parameters(request.settings, request.choices | request.checksums | {"data_checksum": material.checksum})
        for data in _datasets(request, material):
            run.dataset(data)
        reconstruction = _train(settings, parts, material, folder, run, start)
        reconstruction.about |= {"config": request.settings, "choices": request.choices, "run_id": run.run_id}
        outcome = validate(reconstruction, material, trainer_settings(config.trainer, config.seed))
        reconstruction.monitor = commissioned(config, reconstruction.network, material, outcome)
        reconstruction.save(folder / MODEL)
        metrics = _logged(outcome, run)
        log_model(run, folder / MODEL, _example_v(material))
    job = Job(folder, run.run_id, metrics)
    job.keep()
    return job


def _begin(folder: Path, data_checksum: str) -> None:
    """Make the folder; what was begun there on other data, as those of an earlier version, is begun again."""
    path = folder / BEGUN
    if path.is_file() and json.loads(path.read_text(encoding="utf-8")) != {"data_checksum": data_checksum}:
        print(f"training anew: {folder} was begun on other data", file=sys.stderr, flush=True)
        shutil.rmtree(folder)
    write_whole(path, json.dumps({"data_checksum": data_checksum}))


def _datasets(request: Request, material: Material) -> list[DatasetInfo]:
    """The trials that were simulated, and the recording that they come from."""
    counts = {"trials": len(material.trials), "taxels": len(material.taxel_m)}
    if material.denoiser is not None:
        counts["denoiser_trials"] = len(material.denoiser)
    name = " ".join(["trials", *(request.choices[group] for group in ("data", "grid") if group in request.choices)])
    trials = DatasetInfo(name, material.checksum, "training", profile=counts)
    if request.settings["recording"] is None:
        return [trials]
    recording = Path(request.settings["recording"])
    return [trials, DatasetInfo(recording.name, request.checksums["recording_checksum"], "training", recording)]


def _example_v(material: Material) -> NDArray[np.float32]:
    """(1,K,M) what a model takes in: the change of a scan under a simulated press, in volt."""
    return material.trials[slice(0, 1)].readings_v(material.protocol).reshape(-1, *material.protocol.shape)


def _train(
    settings: TrainerSettings,
    parts: dict[str, Any],
    material: Material,
    folder: Path,
    run: Run,
    start: Reconstruction | None,
) -> Reconstruction:
    def log(stage: str, losses: dict[str, float], epoch: int) -> None:
        run.metrics({f"{stage}_{name}": value for name, value in losses.items()}, epoch)

    reconstruction, fitted = train_reconstruction(
        material, parts["network"], parts["denoiser"], settings, folder, log, start
    )
    for stage, outcome in fitted.items():
        # A table shows a metric's last value: this one must be the best.
        run.metrics({f"{stage}_best_loss": outcome.loss, f"{stage}_best_epoch": outcome.epoch})
    return reconstruction


def built(model: DictConfig) -> dict[str, Any]:
    """Part of the model -> its class with arguments, None where it has no such part; ``UserError`` for a wrong one."""
    parts = {part: hydra.utils.instantiate(model[part]) for part in ("network", "denoiser")}
    for part, build in parts.items():
        if build is not None:
            check_arguments(build.func, build.keywords, f"model.{part}")
    return parts


def _logged(outcome: Validation, run: Run) -> dict[str, float]:
    metrics = {f"validation_{name}": score.value for name, score in outcome.scores.items()}
    run.metrics(metrics)
    run.table(as_builtins(outcome.scores), "validation/per_taxel.json")
    for name, figure in outcome.figures().items():
        run.figure(figure, f"validation/{name}")
    return metrics
