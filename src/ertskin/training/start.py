"""What a training starts from: the network of another specimen."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ertskin.errors import UserError
from ertskin.settings import whole_number
from ertskin.training.settings import TrainerSettings

if TYPE_CHECKING:
    from omegaconf import DictConfig

    from ertskin.models.network import Network
    from ertskin.models.reconstruction import Reconstruction
    from ertskin.physics.protocol import Protocol


def start_checksums(config: DictConfig) -> dict[str, Any]:
    """What the outcome depends on besides settings and data: the model that is started from, and for how long.

    Nothing where a training starts afresh. Raises ``UserError`` where there is no such model.
    """
    if not config.get("from"):
        return {}
    from ertskin.data.shards import file_sha256
    from ertskin.tracking.model import model_file
    from ertskin.tracking.settings import TrackingSettings

    file = model_file(str(config["from"]), TrackingSettings.of(config.tracking))
    return {"start_checksum": file_sha256(file), "tune_epochs": _tune_epochs(config)}


def starting(config: DictConfig, settings: TrainerSettings) -> tuple[Reconstruction | None, TrainerSettings]:
    """The model ``config`` starts from, None for afresh, and the trainer's settings for it; raises ``UserError``."""
    if not config.get("from"):
        return None, settings
    from ertskin.models.reconstruction import Reconstruction
    from ertskin.tracking.model import model_file
    from ertskin.tracking.settings import TrackingSettings

    start = Reconstruction.load(model_file(str(config["from"]), TrackingSettings.of(config.tracking)))
    return start, replace(settings, max_epochs=_tune_epochs(config))


def check_start(
    start: Reconstruction, kind: type[Network], denoiser: bool, epochs: int, protocol: Protocol | None
) -> None:
    """Raise ``UserError`` where a network of that ``kind``, for scans by ``protocol``, can't start from ``start``."""
    if type(start.network) is not kind or denoiser != (start.denoiser is not None):
        raise UserError(f"from: holds a {type(start.network).__name__}, choose the model it was trained as")
    if not epochs and not kind.recalibrates:
        raise UserError("tune_epochs=0 keeps the weights, and only those of model=contacts do without training")
    shapes = [each.design.shape for each in (start.protocol, protocol or start.protocol)]
    if shapes[0] != shapes[1]:
        counts = " and ".join(f"{pairs} of {readings}" for readings, pairs in shapes)
        raise UserError(f"from: scans differ, {counts} readings: another specimen must have as many electrodes")


def _tune_epochs(config: DictConfig) -> int:
    return whole_number(config.tune_epochs, "tune_epochs", least=0)
