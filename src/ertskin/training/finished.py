"""A finished job on disk: written when it ends, found again without loading what it took to train."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ertskin.data.shards import file_sha256
from ertskin.errors import UserError
from ertskin.files import write_whole
from ertskin.tracking.settings import TrackingSettings
from ertskin.tracking.store import is_finished

DONE, MODEL = "done.json", "model.pt"


@dataclass(frozen=True)
class Job:
    """A finished job: its folder, its MLflow run and the metrics of its validation."""

    folder: Path
    run_id: str
    metrics: dict[str, float]

    @property
    def model(self) -> Path:
        """Path of its model."""
        return self.folder / MODEL

    def keep(self) -> None:
        """Mark the folder as finished."""
        content = {
            "run_id": self.run_id,
            "metrics": self.metrics,
            "model_sha256": file_sha256(self.model),
            "networks_sha256": networks_sha256(),
        }
        write_whole(self.folder / DONE, json.dumps(content, indent=1))


def latest_job(folder: Path) -> Path:
    """Folder of the job below ``folder`` that ended last; raises ``UserError`` where none has."""
    done = sorted(folder.glob(f"*/{DONE}"), key=lambda path: path.stat().st_mtime)
    if not done:
        raise UserError(f"no finished training below {folder}: train one, or name network=FILE")
    return done[-1].parent


def finished_job(folder: Path, tracking: TrackingSettings) -> Job | None:
    """The job where both its folder and the tracking database know it as finished.

    A folder whose model this version can't load any more is removed: its checkpoints are of that version too.
    """
    if not ((folder / DONE).is_file() and (folder / MODEL).is_file()):
        return None
    content = json.loads((folder / DONE).read_text(encoding="utf-8"))
    job = Job(folder, content["run_id"], content["metrics"])
    if not _known_to_load(job, content):
        if not _loads(job.model):
            shutil.rmtree(folder)
            return None
        ended_s = (folder / DONE).stat().st_mtime
        job.keep()  # Loading takes seconds: once is enough.
        os.utime(folder / DONE, (ended_s, ended_s))  # Which job ended last stays as it is.
    return job if is_finished(tracking.database, job.run_id) else None


def _known_to_load(job: Job, content: dict[str, Any]) -> bool:
    """Whether neither the model nor any network's source has changed since it could be loaded."""
    same = content.get("model_sha256") == file_sha256(job.model)
    return same and content.get("networks_sha256") == networks_sha256()


def _loads(model: Path) -> bool:
    from ertskin.models.reconstruction import Reconstruction

    try:
        Reconstruction.load(model)
    except UserError as error:
        print(f"training anew: {error}", file=sys.stderr, flush=True)
        return False
    return True


def networks_sha256() -> str:
    """Of the source of every network: while it is the same, a model that could be loaded still can."""
    source = hashlib.sha256()
    for path in sorted((Path(__file__).parents[1] / "models").glob("*.py")):
        source.update(path.read_bytes())
    return source.hexdigest()
