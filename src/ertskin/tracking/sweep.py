"""A sweep: one parent run, a child for each job, jobs named by what they compute."""

from __future__ import annotations

import atexit
import hashlib
import json
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.core.hydra_config import HydraConfig
from hydra.experimental.callback import Callback
from hydra.types import RunMode
from omegaconf import DictConfig

from ertskin.files import write_whole
from ertskin.tracking.run import Run
from ertskin.tracking.settings import TrackingSettings
from ertskin.tracking.sweep_summary import JobResult, show_sweep

if TYPE_CHECKING:
    from hydra.core.override_parser.types import Override

PARENT_FILE, RESULTS = "parent.json", "results"


class SweepCallback(Callback):
    """Opens the parent run before the first job; after the last it shows what all of them came to, and closes it.

    Jobs, whichever process runs them, find their parent in the sweep's folder and leave their results there.
    """

    def __init__(self) -> None:
        self.run: Run | None = None
        self.folder = Path()

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """The database is made here, once, before any job's process asks for it."""
        self.folder = Path(config.hydra.sweep.dir).resolve()
        shutil.rmtree(self.folder / RESULTS, ignore_errors=True)
        (self.folder / RESULTS).mkdir(parents=True)
        words, varied = " ".join(config.hydra.overrides.task), _varied(config.hydra)
        name = f"sweep over {', '.join(key.rpartition('.')[2] for key in varied)}" if varied else "sweep"
        settings = TrackingSettings.of(config.tracking)
        self.run = Run.begin(settings, self.folder.name, name, {"ertskin.sweep": words}, reopen=True)
        write_whole(self.folder / PARENT_FILE, json.dumps({"run_id": self.run.run_id, "swept": varied}))
        atexit.register(self._end, "FAILED")

    def on_multirun_end(self, config: DictConfig, **kwargs: Any) -> None:
        """Reached only where every job succeeded."""
        self._end("FINISHED")

    def _end(self, status: str) -> None:
        from mlflow.exceptions import MlflowException

        run, self.run = self.run, None
        if run is None:
            return
        results = [
            json.loads(path.read_text(encoding="utf-8")) for path in sorted((self.folder / RESULTS).glob("*.json"))
        ]
        try:
            if results:
                show_sweep(run, [JobResult(**result) for result in results])
        except (MlflowException, OSError) as error:
            # The jobs are done, and their results kept with their own runs.
            print(f"ertskin: the sweep's table could not be kept: {' '.join(str(error).split())}", file=sys.stderr)
        run.end(status)


def choices() -> dict[str, str]:
    """Group of settings -> the name chosen for it, of the command being run; Hydra's own groups left out."""
    if not HydraConfig.initialized():
        return {}
    chosen = HydraConfig.get().runtime.choices
    return {group: str(name) for group, name in chosen.items() if "/" not in group and name is not None}


def parent_run_id() -> str | None:
    """The parent of the job being run, None outside a sweep."""
    return _of_sweep().get("run_id")


def keep_result(key: str, varied: dict[str, Any], metrics: dict[str, float]) -> None:
    """Leave what a job came to for its sweep's table: ``varied`` holds what was swept; nothing outside one."""
    if _of_sweep():
        path = Path(HydraConfig.get().sweep.dir) / RESULTS / f"{key}.json"
        write_whole(path, json.dumps({"varied": varied, "metrics": metrics}))


def swept() -> list[str]:
    """The settings that the sweep of the job being run varies; none outside a sweep."""
    return list(_of_sweep().get("swept", []))


def _of_sweep() -> dict[str, Any]:
    if not HydraConfig.initialized() or HydraConfig.get().mode != RunMode.MULTIRUN:
        return {}
    path = Path(HydraConfig.get().sweep.dir) / PARENT_FILE
    return dict(json.loads(path.read_text(encoding="utf-8")))


def swept_overrides(hydra: DictConfig) -> list[Override]:
    """What gives a key more than one value, on the command line and in the sweeper's own parameters."""
    from hydra.core.override_parser.overrides_parser import OverridesParser

    typed = list(hydra.overrides.task)
    listed = [f"{key}={value}" for key, value in (hydra.sweeper.get("params") or {}).items()]
    parsed = OverridesParser.create().parse_overrides([*listed, *typed])
    return [each for each in parsed if each.is_sweep_override()]


def _varied(hydra: DictConfig) -> list[str]:
    return list(dict.fromkeys(each.get_key_element().lstrip("+~") for each in swept_overrides(hydra)))


def job_key(request: dict[str, Any]) -> str:
    """Short name of a job: the same for the same plain data, in any order of its keys."""
    return hashlib.sha256(json.dumps(request, sort_keys=True, default=str).encode()).hexdigest()[:12]
