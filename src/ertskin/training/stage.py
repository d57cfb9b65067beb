"""One network to be trained: what it is, what it learns from, and where its checkpoints lie."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import torch

from ertskin.data.trials import TrialSet
from ertskin.models.network import Network
from ertskin.training.fit import Fitted, fit
from ertskin.training.progress import Log
from ertskin.training.settings import TrainerSettings
from physics.noise.model import Noise
from physics.protocol import Protocol


@dataclass(frozen=True, eq=False)
class Stage:
    """``build()`` makes the network. Plain data: any process can train it, and what one began another goes on with."""

    name: str
    build: Callable[[], Network]
    protocol: Protocol
    trials: TrialSet
    noise: Noise
    settings: TrainerSettings
    folder: Path

    def fit(self, log: Log | None = None) -> tuple[Network, Fitted]:
        """The network with the weights of its best epoch; where it is trained already these are only read."""
        torch.manual_seed(self.settings.seed)
        network = self.build()
        data = network.prepare(self.protocol, self.trials, self.noise, self.settings.seed)
        return network, fit(network, data, self.settings, self.folder / self.name, title=self.name, log=log)
