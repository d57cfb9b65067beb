"""The shared body of the networks that read the reciprocal numbers."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from ertskin.data.tensors import TrialTensors
from ertskin.data.trials import TrialSet
from ertskin.models.scaling import NoiseWhitening
from ertskin.physics.noise.model import Noise
from ertskin.physics.protocol import Protocol

Targets = dict[str, Tensor]
NOISE_ROWS = 8192


class Trunk(nn.Module):
    """P whitened coordinates of a voltage change to ``width`` features.

    Their strongest ``components`` enter in units of the noise, in three ways. As they are: changes of several light
    contacts nearly add up. By their direction, which hardly depends on the force. Compressed by the inverse hyperbolic
    sine, linear below the noise and logarithmic far above it, so that a light press and a hard one are both seen. Then
    ``blocks`` residual blocks.
    """

    def __init__(self, inputs: int, components: int, width: int, blocks: int, dropout: float = 0.0) -> None:
        super().__init__()
        kept = min(components, inputs)
        self.whiten = NoiseWhitening(inputs, kept)
        self.enter = nn.Linear(3 * kept, width)
        self.blocks = nn.ModuleList(_block(width, dropout) for _ in range(blocks))
        self.leave = nn.LayerNorm(width)

    def prepare(self, protocol: Protocol, trials: TrialSet, noise: Noise, targets: Targets, seed: int) -> TrialTensors:
        """Fit the whitening; inputs in units of the noise, with a bank of noise to add to them."""
        change_v = trials.coordinates_v(protocol)
        self.whiten.fit(change_v, noise.covariance_v2)
        rng = np.random.default_rng(np.random.SeedSequence([seed, 2]))
        rows = noise.coordinates(rng, NOISE_ROWS)
        bank = self.whiten(torch.from_numpy(rows).float()) if np.any(rows) else None
        return TrialTensors(self.whiten(torch.from_numpy(change_v).float()), targets, bank)

    def forward(self, whitened: Tensor) -> Tensor:
        """(N,components) in units of the noise to (N,width)."""
        length = (1.0 + whitened.square().sum(dim=1, keepdim=True)).sqrt()
        direction = whitened / length * whitened.shape[1] ** 0.5
        ways = [whitened / self.whiten.strength, direction, torch.asinh(whitened)]
        features = self.enter(torch.cat(ways, dim=1))
        for block in self.blocks:
            features = features + block(features)
        return self.leave(features)


def _block(width: int, dropout: float) -> nn.Sequential:
    return nn.Sequential(
        nn.LayerNorm(width), nn.Linear(width, width), nn.GELU(), nn.Dropout(dropout), nn.Linear(width, width)
    )
