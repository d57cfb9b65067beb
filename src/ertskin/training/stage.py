"""One network to be trained: what it is, what it learns from, and where its checkpoints lie."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import torch

from ertskin.data.tensors import TrialTensors
from ertskin.data.trials import TrialSet
from ertskin.models.network import Network
from ertskin.physics.noise.model import Noise
from ertskin.physics.protocol import Protocol
from ertskin.training.fit import Fitted, fit
from ertskin.training.progress import Log
from ertskin.training.settings import TrainerSettings


@dataclass(frozen=True, eq=False)
class Stage:
    """``build()`` makes the network, which starts from ``start`` where that is given. Plain data: any process can train
    it, and what one began another goes on with."""

    name: str
    build: Callable[[], Network]
    protocol: Protocol
    trials: TrialSet
    noise: Noise
    settings: TrainerSettings
    folder: Path
    start: Network | None = None

    def fit(self, log: Log | None = None) -> tuple[Network, Fitted]:
        """The network with the weights of its best epoch; where it is trained already these are only read.

        Raises ``UserError`` where it can't start from the network it is to start from.
        """
        network, data = self._begun()
        return network, fit(network, data, self.settings, self.folder / self.name, title=self.name, log=log)

    def recalibrated(self) -> Network:
        """The network with the weights it starts from, fitted to this specimen without training; raises as ``fit``."""
        return self._begun()[0].eval()

    def _begun(self) -> tuple[Network, TrialTensors]:
        torch.manual_seed(self.settings.seed)
        network = self.build()
        if self.start is not None:
            network.start_from(self.start)
        return network, network.prepare(self.protocol, self.trials, self.noise, self.settings.seed)
