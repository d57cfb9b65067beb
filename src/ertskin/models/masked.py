"""The force-estimation network of the paper (IV-A, Fig. 9): a localization part and a force part, multiplied."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ertskin.data.tensors import TrialTensors
from ertskin.data.trials import TrialSet
from ertskin.models.batch_norm import BatchNorm
from ertskin.models.compiled_gradient import CompiledGradient
from ertskin.models.network import Gradient
from ertskin.models.readings_layer import ReadingsLayer
from ertskin.models.scaling import Standardise
from ertskin.models.touch import TouchNetwork
from ertskin.physics.noise.model import Noise
from ertskin.physics.protocol import Protocol


class MaskedNetwork(TouchNetwork):
    """Two hidden layers of ``hidden`` neurons for each part, batch normalisation on all of them.

    Localization: sigmoid activations and output. Force: ReLU, at the output too. The two parts share no weight; they
    are trained side by side, which for Adam is the same as one after the other, and their first layers are kept as
    one matrix.
    """

    def __init__(self, inputs: int, taxel_m: list[list[float]], hidden: int = 36, threshold: float = 0.5) -> None:
        super().__init__(taxel_m, threshold)
        self.arguments = {"inputs": inputs, "taxel_m": taxel_m, "hidden": hidden, "threshold": threshold}
        self.scale = Standardise(inputs)
        self.first = nn.Sequential(ReadingsLayer(inputs, 2 * hidden), BatchNorm(2 * hidden))
        self.location = _rest(hidden, len(taxel_m), nn.Sigmoid)
        self.force = _rest(hidden, len(taxel_m), nn.ReLU)

    def prepare(self, protocol: Protocol, trials: TrialSet, noise: Noise, seed: int) -> TrialTensors:
        """Clean simulated trials, as in the paper: noise is the denoiser's business. Pair resistances less their mean,
        of which the layer makes standardised readings."""
        self.scale.fit(*trials.readings_moments_v(protocol))
        self.readings.set_combinations(protocol.design / self.scale.std.double().numpy()[:, None])
        centred_ohm = trials.change_ohm - trials.change_ohm.mean(axis=0)
        return TrialTensors(torch.from_numpy(centred_ohm).float(), self.targets(trials))

    @property
    def readings(self) -> ReadingsLayer:
        """The first layer of both parts."""
        layer = self.first[0]
        assert isinstance(layer, ReadingsLayer)
        return layer

    def scaled(self, change_v: Tensor) -> Tensor:
        """(N,R) volt to standardised inputs."""
        return self.scale(change_v)

    def layers_out(self, inputs: Tensor) -> tuple[Tensor, Tensor]:
        """(N,n) logits and (N,n) forces in newton from (N,R) standardised readings."""
        return self._behind(self.readings(inputs))

    def trials_out(self, inputs: Tensor) -> tuple[Tensor, Tensor]:
        """The same from (N,P) pair resistances as ``prepare`` gives them."""
        return self._behind(self.readings.of_pairs(inputs))

    def gradient(self) -> Gradient:
        """Compiled on a processor."""
        if self.device.type != "cpu":
            return super().gradient()
        norm = self.first[1]
        assert isinstance(norm, BatchNorm)
        return CompiledGradient(self.readings, norm, self.location, self.force)

    def _behind(self, entered: Tensor) -> tuple[Tensor, Tensor]:
        location, force = self.first[1](entered).chunk(2, dim=1)
        return self.location(location), torch.relu(self.force(force))


def _rest(hidden: int, outputs: int, activation: type[nn.Module]) -> nn.Sequential:
    """A part from its first activation on."""
    return nn.Sequential(
        activation(), nn.Linear(hidden, hidden), BatchNorm(hidden), activation(), nn.Linear(hidden, outputs)
    )
