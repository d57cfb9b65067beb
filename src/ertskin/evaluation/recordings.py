"""The recordings of an evaluation: the one that networks were trained for, and the tests."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ertskin.errors import UserError
from ertskin.hardware.recording import Recording, read_recording

if TYPE_CHECKING:
    from omegaconf import DictConfig

ANYWHERE_ROLE = "anywhere test"
ROLES = {"one": "one-point test", "two": "two-point test", "anywhere": ANYWHERE_ROLE}
"""Setting that names a test, and the part it plays in the report."""


@dataclass(frozen=True)
class EvaluatedRecordings:
    """Path and content of the training recording and of each test; tests by the part they play (``ROLES``)."""

    source: Path
    training: Recording
    test_paths: dict[str, Path]
    tests: dict[str, Recording]


def evaluated_recordings(config: DictConfig) -> EvaluatedRecordings:
    """Read what ``config`` names; raises ``RecordingError``, and ``UserError`` where there is nothing to test on."""
    paths = {role: Path(config[key]) for key, role in ROLES.items() if config[key] is not None}
    if not paths:
        raise UserError("nothing to test on: give one=FILE (single presses), two=FILE (two weights) or anywhere=FILE")
    source = Path(config.recording)
    return EvaluatedRecordings(
        source, read_recording(source), paths, {role: _test_recording(path) for role, path in paths.items()}
    )


def _test_recording(path: Path) -> Recording:
    recording = read_recording(path)
    if recording.frames is not None and not recording.frames.history.touched.any():
        raise UserError(f"{path}: no frame presses at a known place: nothing to test on")
    return recording
