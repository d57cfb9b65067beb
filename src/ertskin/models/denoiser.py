"""The de-noising autoencoder of the paper (IV-A, Fig. 9): measured readings in, simulated readings out."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from ertskin.data.tensors import TrialTensors
from ertskin.data.trials import TrialSet
from ertskin.models.batch_norm import BatchNorm
from ertskin.models.network import Network
from ertskin.models.scaling import Standardise
from ertskin.physics.noise.model import Noise
from ertskin.physics.protocol import Protocol


class Denoiser(Network):
    """R readings to R readings through one hidden layer with batch normalisation and ReLU.

    The paper gives no width: ``hidden`` is assumed. Trials with a real counterpart give that as input; the others
    get noise. Both are scaled by the simulated readings' spread.
    """

    def __init__(self, inputs: int, hidden: int = 128) -> None:
        super().__init__()
        self.arguments = {"inputs": inputs, "hidden": hidden}
        self.scale = Standardise(inputs)
        self.layers = nn.Sequential(nn.Linear(inputs, hidden), BatchNorm(hidden), nn.ReLU(), nn.Linear(hidden, inputs))

    def prepare(self, protocol: Protocol, trials: TrialSet, noise: Noise, seed: int) -> TrialTensors:
        """Pairs of readings; a simulated trial keeps the one noise it was given, as in a data set made once."""
        clean = trials.readings_v(protocol)
        self.scale.fit(*trials.readings_moments_v(protocol))
        rng = np.random.default_rng(np.random.SeedSequence([seed, 1]))
        given = clean + noise.readings(rng, len(clean))
        if trials.measured_v is not None:
            real = np.isfinite(trials.measured_v).all(axis=1)
            given[real] = trials.measured_v[real]
        inputs, targets = (self.scale(torch.from_numpy(values.astype(np.float32))) for values in (given, clean))
        return TrialTensors(inputs, {"clean": targets})

    def forward(self, readings_v: Tensor) -> Tensor:
        """(N,R) volt to (N,R) volt."""
        return self.scale.inverse(self.layers(self.scale(readings_v)))

    def losses(self, inputs: Tensor, targets: dict[str, Tensor]) -> dict[str, Tensor]:
        """Mean square error in units of each reading's spread."""
        return {"denoising": nn.functional.mse_loss(self.layers(inputs), targets["clean"])}
