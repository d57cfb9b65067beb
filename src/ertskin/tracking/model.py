"""The trained model as an artifact of its run, and back."""

from __future__ import annotations

from pathlib import Path

from ertskin.models.reconstruction import Reconstruction
from ertskin.tracking.run import Run, fetch
from ertskin.tracking.settings import TrackingSettings

ARTIFACT = "model/model.pt"


def log_model(run: Run, path: Path) -> None:
    """Log a file ``Reconstruction.save`` wrote."""
    folder, name = ARTIFACT.rsplit("/", 1)
    if path.name != name:
        raise ValueError(f"the model's file must be called {name}, not {path.name}")
    run.artifact(path, folder)


def load_model(settings: TrackingSettings, run_id: str) -> Reconstruction:
    """The model of a run, loaded without executing anything from the file."""
    return Reconstruction.load(fetch(settings, run_id, ARTIFACT))
