"""Where runs are kept."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from omegaconf import DictConfig

from ertskin.settings import checked, limited


@dataclass(frozen=True)
class TrackingSettings:
    """``database``: an SQLite file. ``artifacts``: the folder of files logged. ``flush_s``: least time between two
    writes of metrics."""

    database: Path
    artifacts: Path
    experiment: str
    flush_s: float = limited(5.0, least=0)

    @classmethod
    def of(cls, config: DictConfig) -> TrackingSettings:
        """From the configuration group ``tracking``."""
        return checked(cls, config, "tracking")
