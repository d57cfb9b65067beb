"""The calibration a command works with: the one it is given, or its recording's own, made when it is missing."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

from omegaconf import DictConfig

from ertskin.calibration.fit import fit_recording
from ertskin.calibration.result import Calibration
from ertskin.calibration.store import load_calibration, save_calibration
from ertskin.data.shards import file_sha256
from ertskin.data.sources import CALIBRATION, calibration_path
from ertskin.hardware.recording import Recording


def ready_calibration(config: DictConfig, recording: Recording) -> tuple[Calibration, str]:
    """The calibration and its checksum: ``config.calibration.file``, or that of ``config.recording``."""
    path = calibration_path(config)
    if config.calibration.file is None and not path.is_file():
        source = Path(config.recording)
        print(f"calibrating on {source} (ertskin calibrate draws the figures)", file=sys.stderr, flush=True)
        found, _ = fit_recording(recording, source.name, resolution=config.physics.resolution)
        save_calibration(path, found)
    if config.calibration.file is None and config.get("effects") and path.name == CALIBRATION:
        _say_apart(path)
    return load_calibration(path), file_sha256(path)


@cache
def _say_apart(path: Path) -> None:
    """Once for each file: a step asks for its calibration more than once."""
    print(
        f"effects on top of {path}, which was fitted without them (ertskin diagnose keeps one that was)",
        file=sys.stderr,
        flush=True,
    )
