"""How the numbers of a page came about: file, settings, versions."""

from __future__ import annotations

from pathlib import Path

from ertskin import __version__
from ertskin.data.shards import file_sha256
from ertskin.tracking.run import source_commit


def provenance(source: Path, resolution: str) -> tuple[str, ...]:
    """Lines for the foot of a page made from the recording at ``source``."""
    return (
        f"recording: {source} ({file_sha256(source)[:12]})",
        f"settings: physics={resolution}",
        f"ertskin {__version__}, commit {source_commit() or 'unknown'}",
    )
