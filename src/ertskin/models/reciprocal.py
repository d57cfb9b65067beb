"""A network on the P reciprocal numbers behind the readings, seen in units of their noise."""

from __future__ import annotations

from typing import ClassVar

from torch import Tensor, nn

from ertskin.data.tensors import TrialTensors
from ertskin.data.trials import TrialSet
from ertskin.models.network import Reads
from ertskin.models.single_touch import SingleTouch
from ertskin.models.touch import TouchNetwork
from ertskin.models.trunk import Trunk
from ertskin.physics.noise.model import Noise
from ertskin.physics.protocol import Protocol


class ReciprocalNetwork(TouchNetwork):
    """Residual network with one head for the mask and one for the force; noise is drawn anew every epoch.

    Once trained, the force of a single touch is read off the taxel's own curve (``SingleTouch``).
    """

    reads: ClassVar[Reads] = "coordinates"

    def __init__(
        self,
        inputs: int,
        taxel_m: list[list[float]],
        components: int = 64,
        width: int = 128,
        blocks: int = 2,
        dropout: float = 0.0,
        threshold: float = 0.5,
    ) -> None:
        super().__init__(taxel_m, threshold)
        self.arguments = dict(
            inputs=inputs,
            taxel_m=taxel_m,
            components=components,
            width=width,
            blocks=blocks,
            dropout=dropout,
            threshold=threshold,
        )
        self.trunk = Trunk(inputs, components, width, blocks, dropout)
        self.head = nn.Linear(width, 2 * len(taxel_m))
        self.single = SingleTouch(len(taxel_m), min(components, inputs))

    def prepare(self, protocol: Protocol, trials: TrialSet, noise: Noise, seed: int) -> TrialTensors:
        """Coordinates in units of the noise, and a bank of noise."""
        tensors = self.trunk.prepare(protocol, trials, noise, self.targets(trials), seed)
        self.single.fit(trials, tensors.inputs)
        return tensors

    def scaled(self, change_v: Tensor) -> Tensor:
        """(N,P) volt to units of the noise."""
        return self.trunk.whiten(change_v)

    def layers_out(self, inputs: Tensor) -> tuple[Tensor, Tensor]:
        """(N,n) logits and (N,n) forces in newton."""
        logit, raw = self.head(self.trunk(inputs)).chunk(2, dim=1)
        force = nn.functional.softplus(raw)
        return logit, force if self.training else self.single(inputs, logit, force, self.threshold)
