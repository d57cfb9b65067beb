"""From trials to a reconstruction: the denoiser where the model has one, then the network."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import torch

from ertskin.data.material import Material
from ertskin.data.trials import TrialSet
from ertskin.errors import UserError
from ertskin.models.denoiser import Denoiser
from ertskin.models.network import Network
from ertskin.models.reconstruction import Reconstruction
from ertskin.training.fit import Fitted, fit
from ertskin.training.progress import Log
from ertskin.training.settings import TrainerSettings

LogStage = Callable[[str, dict[str, float], int], None]


def train_reconstruction(
    material: Material,
    build_network: partial[Network],
    build_denoiser: partial[Denoiser] | None,
    settings: TrainerSettings,
    folder: Path,
    log: LogStage | None = None,
) -> tuple[Reconstruction, dict[str, Fitted]]:
    """Train on ``material``; ``build_*`` are their classes, given all but ``inputs`` and ``taxel_m``.

    ``folder`` keeps one folder of checkpoints for each stage. ``log(stage, metrics, epoch)`` gets each epoch's losses.
    Raises ``UserError`` where the model has a denoiser and the material has nothing to train it on.
    """
    readings, pairs = material.protocol.design.shape
    fitted: dict[str, Fitted] = {}

    def stage(name: str, network: Network, trials: TrialSet) -> None:
        data = network.prepare(material.protocol, trials, material.noise, settings.seed)
        fitted[name] = fit(network, data, settings, folder / name, title=name, log=_named(log, name))

    torch.manual_seed(settings.seed)
    denoiser = None
    if build_denoiser is not None:
        if material.denoiser is None:
            raise UserError("this model has a denoiser, and there are no denoiser trials to train it on")
        denoiser = build_denoiser(inputs=readings)
        stage("denoiser", denoiser, material.denoiser)
    torch.manual_seed(settings.seed)
    inputs = pairs if _class(build_network).reads == "coordinates" else readings
    network = build_network(inputs=inputs, taxel_m=material.taxel_m.tolist())
    stage("network", network, material.trials)
    return Reconstruction(material.protocol, network, denoiser, {"data_checksum": material.checksum}), fitted


def _class(build: partial[Network]) -> type[Network]:
    assert isinstance(build.func, type)
    return build.func


def _named(log: LogStage | None, stage: str) -> Log | None:
    return None if log is None else lambda metrics, epoch: log(stage, metrics, epoch)
