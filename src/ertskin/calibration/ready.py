"""The calibration a command works with: the one it is given, or its recording's own, made when it is missing."""

from __future__ import annotations

import sys
from pathlib import Path

from omegaconf import DictConfig

from ertskin.calibration.fit import fit_recording
from ertskin.calibration.result import Calibration
from ertskin.calibration.store import load_calibration, save_calibration
from ertskin.data.shards import file_sha256
from hardware.recording import Recording

FILE = "calibration.yaml"


def calibration_folder(root: Path, recording: Path) -> Path:
    """Where a recording's calibration is kept: named by file and content."""
    return root / f"{recording.stem}-{file_sha256(recording)[:8]}"


def ready_calibration(config: DictConfig, recording: Recording) -> tuple[Calibration, str]:
    """The calibration and its checksum: ``config.calibration.file``, or that of ``config.recording``."""
    if config.calibration.file is not None:
        path = Path(config.calibration.file)
        return load_calibration(path), file_sha256(path)
    source = Path(config.recording)
    path = calibration_folder(Path(config.calibration.folder), source) / FILE
    if not path.is_file():
        print(f"calibrating on {source} (ertskin calibrate draws the figures)", file=sys.stderr, flush=True)
        found, _ = fit_recording(recording, source.name, resolution=config.physics.resolution)
        save_calibration(path, found)
    return load_calibration(path), file_sha256(path)
