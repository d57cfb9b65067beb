"""Train a network on simulated trials, and track it.

A job is named by what it computes: one that is done is not done again, one that was cut off goes on.
"""

from __future__ import annotations

import logging

from omegaconf import DictConfig


def run(config: DictConfig) -> None:
    """Train one job."""
    import hydra

    from ertskin.interrupts import unwind_on_sigterm
    from ertskin.training.job import train_job

    unwind_on_sigterm()
    logging.getLogger("alembic").setLevel(logging.WARNING)
    material = hydra.utils.instantiate(config.data.source)(config)
    job = train_job(config, material)
    words = ", ".join(f"{name.removeprefix('validation_')} {value:.4g}" for name, value in job.metrics.items())
    state = "done before" if job.skipped else "trained"
    print(f"{config.model.name}, seed {config.seed}: {state}: {words}\n  model {job.model}\n  run {job.run_id}")
