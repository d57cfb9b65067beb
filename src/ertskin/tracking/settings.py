"""Where runs are kept."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from omegaconf import DictConfig


@dataclass(frozen=True)
class TrackingSettings:
    """``database``: an SQLite file. ``artifacts``: the folder of files logged. ``flush_s``: least time between two
    writes of metrics."""

    database: Path
    artifacts: Path
    experiment: str
    flush_s: float = 5.0

    @classmethod
    def of(cls, config: DictConfig) -> TrackingSettings:
        """From the configuration group ``tracking``."""
        return cls(Path(config.database), Path(config.artifacts), str(config.experiment), float(config.flush_s))
