"""Train a network on simulated trials, and track it.

A job is named by what it computes: one that is done is not done again, one that was cut off goes on. ``from=RUN``
starts from the network of another specimen with as many electrodes.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omegaconf import DictConfig

    from ertskin.training.finished import Job
    from ertskin.training.request import Request


def run(config: DictConfig) -> None:
    """Train one job, unless it is done."""
    from ertskin.interrupts import unwind_on_sigterm
    from ertskin.tracking.settings import TrackingSettings
    from ertskin.tracking.sweep import keep_result
    from ertskin.training.finished import finished_job
    from ertskin.training.request import check_settings, job_name, requested, varied

    unwind_on_sigterm()
    logging.getLogger("alembic").setLevel(logging.WARNING)
    name, tracking = job_name(config), TrackingSettings.of(config.tracking)
    check_settings(config)
    request = requested(config) or _calibrated(config)
    if done := finished_job(request.folder, tracking):
        _tell(name, "done before", done)
        keep_result(request.key, varied(config), done.metrics)
        return
    print(f"{name}: training", flush=True)  # What follows loads for seconds.
    from ertskin.training.job import train_job

    job = train_job(config, request)
    _tell(name, "trained", job)
    keep_result(request.key, varied(config), job.metrics)


def _calibrated(config: DictConfig) -> Request:
    """The job once its calibration is there: what it computes depends on that."""
    from ertskin.hardware.recording import read_recording

    recording = read_recording(config.recording)  # Refused before what follows loads for seconds.

    from ertskin.calibration.ready import ready_calibration
    from ertskin.training.request import requested

    ready_calibration(config, recording)
    request = requested(config)
    assert request is not None
    return request


def _tell(name: str, state: str, job: Job) -> None:
    from ertskin.report.units import in_words

    words = "; ".join(in_words(metric.removeprefix("validation_"), value) for metric, value in job.metrics.items())
    print(f"{name}: {state}: {words}\n  model {job.model}\n  run {job.run_id}")
