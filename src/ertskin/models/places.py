"""A network that places any number of contacts anywhere on the sheet, not on the taxels alone."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from ertskin.data.tensors import TrialTensors
from ertskin.data.trials import TrialSet
from ertskin.models.estimate import Estimate
from ertskin.models.network import Network, Reads
from ertskin.models.trunk import Trunk
from ertskin.models.votes import counted, grid_spacing_m, on_taxels
from ertskin.physics.noise.model import Noise
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]


class PlacesNetwork(Network):
    """Every taxel votes: is there a contact nearest to me, where exactly, how strong?

    A taxel learns place and force of the contact nearest to it where that is within ``reach`` spacings of the grid, and
    its vote's weight is the chance that it is itself the nearest taxel. Votes that name the same place are added up;
    a place with more than ``threshold`` of weight is a contact. A contact between two taxels, which each half claim,
    is so found once, in between. The number of contacts is bounded by the taxels alone.
    """

    reads: ClassVar[Reads] = "coordinates"
    taxel_m: Tensor
    force_unit_n: Tensor

    def __init__(
        self,
        inputs: int,
        taxel_m: list[list[float]],
        components: int = 64,
        width: int = 128,
        blocks: int = 2,
        dropout: float = 0.0,
        reach: float = 1.2,
        threshold: float = 0.5,
    ) -> None:
        super().__init__()
        self.arguments = dict(
            inputs=inputs,
            taxel_m=taxel_m,
            components=components,
            width=width,
            blocks=blocks,
            dropout=dropout,
            reach=reach,
            threshold=threshold,
        )
        self.reach, self.threshold = reach, threshold
        self.register_buffer("taxel_m", torch.tensor(taxel_m))
        self.register_buffer("force_unit_n", torch.ones(()))
        self.spacing_m = grid_spacing_m(np.array(taxel_m))
        self.trunk = Trunk(inputs, components, width, blocks, dropout)
        self.head = nn.Linear(width, 4 * len(taxel_m))

    def prepare(self, protocol: Protocol, trials: TrialSet, noise: Noise, seed: int) -> TrialTensors:
        """Coordinates in units of the noise, and a bank of noise."""
        targets = nearest_contacts(trials, np.asarray(self.taxel_m, dtype=float), self.reach * self.spacing_m)
        tensors = {name: torch.from_numpy(value).float() for name, value in targets.items()}
        tensors["offset"] /= self.spacing_m
        self.force_unit_n.fill_(float(np.sqrt(np.nanmean(trials.force_n**2))))
        return self.trunk.prepare(protocol, trials, noise, tensors, seed)

    def layers_out(self, inputs: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """(N,n) logits, (N,n) forces in newton, (N,n,2) offsets in spacings."""
        logit, force, offset = self.head(self.trunk(inputs)).split([self._n, self._n, 2 * self._n], dim=1)
        return logit, nn.functional.softplus(force), offset.unflatten(1, (self._n, 2))

    def losses(self, inputs: Tensor, targets: dict[str, Tensor]) -> dict[str, Tensor]:
        """Cross entropy of being the nearest; squared errors of force and place where a contact is in reach.

        Forces in units of their rms and places in spacings: neither outweighs the other.
        """
        logit, force, offset = self.layers_out(inputs)
        near = targets["in_reach"]
        away = (offset - targets["offset"]).square().sum(dim=2)
        return {
            "location": nn.functional.binary_cross_entropy_with_logits(logit, targets["nearest"]),
            "force": (near * ((force - targets["force_n"]) / self.force_unit_n).square()).mean(),
            "place": (near * away).mean(),
        }

    @torch.no_grad()
    def estimate(self, change_v: Tensor) -> Estimate:
        """Contacts of (N,P) voltage changes, and the same on the taxels nearest to them."""
        logit, force, offset = self.layers_out(self.trunk.whiten(change_v))
        answers = (torch.sigmoid(logit), force, self.taxel_m + self.spacing_m * offset)
        weight, force_n, place_m = (answer.double().cpu().numpy() for answer in answers)
        found = [
            counted(*votes, radius_m=0.5 * self.spacing_m, threshold=self.threshold)
            for votes in zip(weight, force_n, place_m, strict=True)
        ]
        return on_taxels(found, np.asarray(self.taxel_m.cpu(), dtype=float))

    @property
    def _n(self) -> int:
        return len(self.taxel_m)


def nearest_contacts(trials: TrialSet, taxel_m: Array, reach_m: float) -> dict[str, Array]:
    """For every trial and taxel the contact nearest to it.

    ``nearest`` (N,n): 1 where the taxel is also that contact's nearest one. ``in_reach`` (N,n): 1 where it lies within
    ``reach_m``. ``force_n`` (N,n) its force and ``offset`` (N,n,2) its place in metres from the taxel, 0 out of reach.
    """
    away_m = np.linalg.norm(trials.contact_m[:, :, None, :] - taxel_m, axis=-1)
    away_m = np.where(np.isfinite(away_m), away_m, np.inf)
    nearest = np.zeros((len(trials), len(taxel_m)))
    row, slot = np.nonzero(np.isfinite(trials.force_n))
    nearest[row, away_m[row, slot].argmin(axis=1)] = 1.0
    contact = away_m.argmin(axis=1)
    in_reach = np.take_along_axis(away_m, contact[:, None], axis=1)[:, 0] <= reach_m
    rows = np.arange(len(trials))[:, None]
    force = np.where(in_reach, trials.force_n[rows, contact], 0.0)
    offset = np.where(in_reach[..., None], trials.contact_m[rows, contact] - taxel_m, 0.0)
    return {"nearest": nearest, "in_reach": in_reach.astype(float), "force_n": force, "offset": offset}
