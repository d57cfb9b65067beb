"""The files that simulated trials come from: where they lie, and the checksums of what they hold."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ertskin.data.shards import file_sha256
from ertskin.errors import UserError

if TYPE_CHECKING:
    from omegaconf import DictConfig

CALIBRATION = "calibration.yaml"


def calibration_folder(root: Path, recording: Path) -> Path:
    """Where a recording's calibration is kept: named by file and content."""
    return root / f"{recording.stem}-{file_sha256(recording)[:8]}"


def joint_calibration_name(effects: dict[str, Any]) -> str:
    """File name of a calibration that was fitted together with ``effects`` ({name: {parameter: value}})."""
    words = json.dumps(effects, sort_keys=True).encode()
    return f"calibration-with-{hashlib.sha256(words).hexdigest()[:8]}.yaml"


def calibration_path(config: DictConfig) -> Path:
    """The calibration that is used: ``config.calibration.file``, or that of ``config.recording``.

    With effects as a diagnosis of the recording found them, the one fitted together with them.
    """
    from omegaconf import OmegaConf

    if config.calibration.file is not None:
        return Path(config.calibration.file)
    folder = calibration_folder(Path(config.calibration.folder), Path(config.recording))
    effects = OmegaConf.to_container(config.get("effects") or OmegaConf.create({}), resolve=True)
    joint = folder / joint_calibration_name(dict(effects))  # type: ignore[arg-type]
    return joint if effects and joint.is_file() else folder / CALIBRATION


def source_checksums(config: DictConfig) -> dict[str, str] | None:
    """SHA-256 by parameter name, none for data without a recording; None while the calibration is still to be made.

    Raises ``UserError`` where the recording or the calibration that is named isn't there.
    """
    if config.recording is None:
        return {}
    recording, calibration = Path(config.recording), config.calibration.file
    for path in (recording, *([Path(calibration)] if calibration is not None else [])):
        if not path.is_file():
            raise UserError(f"{path}: no such file")
    if not calibration_path(config).is_file():
        return None
    return {
        "recording_checksum": file_sha256(recording),
        "calibration_checksum": file_sha256(calibration_path(config)),
    }
