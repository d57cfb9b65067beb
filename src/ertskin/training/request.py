"""What a training job computes: known from settings and files alone, before anything heavy is loaded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ertskin.data.sources import source_checksums
from ertskin.tracking.sweep import choices, job_key, swept
from ertskin.training.start import start_checksums

if TYPE_CHECKING:
    from omegaconf import DictConfig

ASIDE = (
    "tracking",
    "out",
    "cluster",
    "recording",
    "calibration",
    "data.folder",
    "data.plan.shard",
    "from",
    "tune_epochs",
    "trainer.checkpoint_s",
    "trainer.batches_per_chunk",
)
"""What the outcome doesn't depend on: where things lie (what the files hold is in the checksums), how often something
is saved, how much is computed at a time. What a training starts from counts where it starts from something."""


@dataclass(frozen=True)
class Request:
    """``settings``: the whole configuration. ``checksums``: of the files the data come from. ``choices``: the name
    chosen for each group. ``key``: short name of the outcome. ``folder``: where the job is kept."""

    settings: dict[str, Any]
    checksums: dict[str, str]
    choices: dict[str, str]
    key: str
    folder: Path


def requested(config: DictConfig) -> Request | None:
    """The job ``config`` asks for; None while its calibration is still to be made."""
    from omegaconf import OmegaConf

    checksums = source_checksums(config)
    if checksums is None:
        return None
    checksums |= start_checksums(config)
    settings = cast(dict[str, Any], OmegaConf.to_container(config, resolve=True))
    key = job_key(deciding(settings) | checksums)
    return Request(settings, checksums, choices(), key, Path(config.out) / key)


def deciding(settings: dict[str, Any], aside: tuple[str, ...] = ASIDE) -> dict[str, Any]:
    """The settings without those named in ``aside``."""
    kept: dict[str, Any] = {}
    for name, value in settings.items():
        if name not in aside:
            within = tuple(key.removeprefix(f"{name}.") for key in aside if key.startswith(f"{name}."))
            kept[name] = deciding(value, within) if isinstance(value, dict) else value
    return kept


def check_settings(config: DictConfig) -> None:
    """``UserError`` for a wrong value, as far as one shows before networks are loaded."""
    from ertskin.data.synthesis import check_plan
    from ertskin.tracking.settings import TrackingSettings
    from ertskin.training.settings import trainer_settings

    TrackingSettings.of(config.tracking)
    trainer_settings(config.trainer, config.seed)
    check_plan(config.data)


def varied(config: DictConfig) -> dict[str, Any]:
    """What the sweep of this job varies, and the value or the choice that this job has of each."""
    from omegaconf import OmegaConf

    chosen = choices()
    return {key: chosen[key] if key in chosen else OmegaConf.select(config, key) for key in swept()}


def job_name(config: DictConfig) -> str:
    """What a table of runs shows: the network, the grid, effects simulated, what else a sweep varies, the seed."""
    chosen, of_sweep = choices(), varied(config)
    words = [chosen.get("model", str(config.model.name))]
    if chosen.get("grid", "recording") != "recording":
        words.append(chosen["grid"])
    if chosen.get("effects", "none") != "none" and "effects" not in of_sweep:
        words.append(chosen["effects"])
    for key, value in of_sweep.items():
        if key not in ("model", "grid", "seed"):
            words.append(str(value) if key in chosen else f"{key.rpartition('.')[2]} {value}")
    return " ".join([*words, f"seed {config.seed}"])
