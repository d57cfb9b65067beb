"""A sweep: one parent run, a child for each job, jobs named by what they compute."""

from __future__ import annotations

import atexit
import hashlib
import json
import os
from pathlib import Path
from typing import Any

from hydra.core.hydra_config import HydraConfig
from hydra.experimental.callback import Callback
from hydra.types import RunMode
from omegaconf import DictConfig

from ertskin.tracking.run import Run
from ertskin.tracking.settings import TrackingSettings

PARENT_FILE = "parent.json"


class SweepCallback(Callback):
    """Opens the parent run before the first job and closes it after the last; jobs find it in the sweep's folder."""

    def __init__(self) -> None:
        self.run: Run | None = None

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """The database is made here, once, before any job's process asks for it."""
        folder = Path(config.hydra.sweep.dir)
        folder.mkdir(parents=True, exist_ok=True)
        words = " ".join(config.hydra.overrides.task)
        settings = TrackingSettings.of(config.tracking)
        self.run = Run.begin(settings, folder.name, f"sweep: {words}", {"ertskin.sweep": words}, reopen=True)
        aside = folder / f"{PARENT_FILE}.part"
        aside.write_text(json.dumps({"run_id": self.run.run_id}), encoding="utf-8")
        os.replace(aside, folder / PARENT_FILE)
        atexit.register(self._end, "FAILED")

    def on_multirun_end(self, config: DictConfig, **kwargs: Any) -> None:
        """Reached only where every job succeeded."""
        self._end("FINISHED")

    def _end(self, status: str) -> None:
        run, self.run = self.run, None
        if run is not None:
            run.end(status)


def parent_run_id() -> str | None:
    """The parent of the job being run, None outside a sweep."""
    if not HydraConfig.initialized() or HydraConfig.get().mode != RunMode.MULTIRUN:
        return None
    path = Path(HydraConfig.get().sweep.dir) / PARENT_FILE
    return json.loads(path.read_text(encoding="utf-8"))["run_id"]


def job_key(request: dict[str, Any]) -> str:
    """Short name of a job: the same for the same plain data, in any order of its keys."""
    return hashlib.sha256(json.dumps(request, sort_keys=True, default=str).encode()).hexdigest()[:12]
