"""What a diagnosis is called on disk."""

from __future__ import annotations

import re
from pathlib import Path


def config_name(recording: Path) -> str:
    """A name Hydra takes for the choice that a recording's diagnosis writes."""
    return re.sub(r"[^A-Za-z0-9_]+", "_", recording.stem).strip("_") or "diagnosed"
