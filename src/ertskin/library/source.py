"""A recording given as such or as the path of its file."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from ertskin.hardware.measurement import Recording
from ertskin.hardware.recording import read_recording

RecordingSource = Recording | str | PathLike[str]


def recording_of(source: RecordingSource) -> tuple[Recording, str]:
    """The recording and a name for it; raises ``RecordingError`` where a file can't be read."""
    if isinstance(source, Recording):
        return source, source.rig or "recording"
    path = Path(source)
    return read_recording(path), path.name
