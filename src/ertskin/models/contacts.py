"""Contacts anywhere, any number of them: a network proposes, the tabulated forward model decides and says how sure."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ertskin.data.tensors import TrialTensors
from ertskin.data.touch_model import TouchModel
from ertskin.data.trials import TrialSet
from ertskin.errors import UserError
from ertskin.models.deciding import INTERPLAY, SURE, TABLE, estimate_of, posterior_of, proposals
from ertskin.models.estimate import Estimate
from ertskin.models.network import Reads
from ertskin.models.places import PlacesNetwork, nearest_contacts
from ertskin.models.trunk import NOISE_ROWS
from ertskin.models.votes import grid_spacing_m
from ertskin.physics.noise.model import Noise
from ertskin.physics.protocol import Protocol
from ertskin.physics.touch.search import EXCHANGES, TouchPosterior

Array = NDArray[np.float64]


class ContactsNetwork(PlacesNetwork):
    """Votes of a lattice of places twice as fine as the taxels propose contacts; ``TouchPosterior`` refines them.

    The posterior's table travels with the weights. ``shapes``: of what it consists of, known once it is prepared.
    """

    reads: ClassVar[Reads] = "coordinates"
    recalibrates: ClassVar[bool] = True
    # Crowded contacts are searched for: hundreds of trials take as long as the training.
    validated: ClassVar[int] = 400

    def __init__(
        self,
        inputs: int,
        taxel_m: list[list[float]],
        components: int = 96,
        width: int = 192,
        blocks: int = 2,
        dropout: float = 0.0,
        reach: float = 1.2,
        threshold: float = 0.3,
        least_force_n: float = 0.15,
        most: int = 4,
        shapes: dict[str, list[int]] | None = None,
    ) -> None:
        super().__init__(inputs, lattice_m(taxel_m), components, width, blocks, dropout, reach, threshold)
        self.arguments |= dict(taxel_m=taxel_m, least_force_n=least_force_n, most=most, shapes=shapes)
        self.least_force_n, self.most, self.exchanges = least_force_n, most, EXCHANGES
        self.register_buffer("answer_m", torch.tensor(taxel_m))
        self._posterior: TouchPosterior | None = None
        if shapes is not None and set(shapes) != {*TABLE, *INTERPLAY, *SURE}:
            raise UserError("these contacts were trained with another version's errors of the response: train again")
        for name, shape in (shapes or {}).items():
            self.register_buffer(name, torch.zeros(shape, dtype=_kind(name)))

    def prepare(self, protocol: Protocol, trials: TrialSet, noise: Noise, seed: int) -> TrialTensors:
        """Take in the trials' table; coordinates in units of the noise, and a bank of noise."""
        if trials.touch is None:
            raise UserError("this model learns from touches anywhere: choose data=anywhere")
        whiten = self.trunk.whiten
        touch = trials.touch.along(whiten.matrix.double().numpy()) if whiten.kept else trials.touch
        self._take(touch)
        targets = nearest_contacts(trials, np.asarray(self.taxel_m, dtype=float), self.reach * self.spacing_m)
        tensors = {name: torch.from_numpy(value).float() for name, value in targets.items()}
        tensors["offset"] /= self.spacing_m
        self.force_unit_n.fill_(float(np.sqrt(np.nanmean(trials.force_n**2))))
        inputs = trials.coordinates_v(protocol) @ touch.matrix
        whiten.matrix.copy_(torch.from_numpy(touch.matrix))
        whiten.strength.fill_(float(np.sqrt(np.mean(inputs**2))))
        rng = np.random.default_rng(np.random.SeedSequence([seed, 2]))
        bank = noise.coordinates(rng, NOISE_ROWS) @ touch.matrix
        noisy = torch.from_numpy(bank).float() if np.any(bank) else None
        return TrialTensors(torch.from_numpy(inputs).float(), tensors, noisy)

    @property
    def answers_m(self) -> Array:
        """(n,2) the taxels contacts are counted on; the lattice that votes is finer."""
        return np.asarray(self.answer_m.cpu(), dtype=float)

    @property
    def posterior(self) -> TouchPosterior:
        """The tabulated forward model and what it may err by."""
        if self._posterior is None:
            self._posterior = posterior_of(self.held(), self.least_force_n, self.most, exchanges=self.exchanges)
        return self._posterior

    def held(self) -> dict[str, Any]:
        """The arrays the posterior consists of, by name."""
        return {name: getattr(self, name).cpu().numpy() for name in (*TABLE, *INTERPLAY, *SURE)}

    @torch.no_grad()
    def estimate(self, change_v: Tensor) -> Estimate:
        """Contacts of (N,P) voltage changes with their covariances, and the same on the taxels nearest to them."""
        whitened = self.trunk.whiten(change_v)
        logit, force, offset = self.layers_out(whitened)
        votes = (torch.sigmoid(logit), force, self.taxel_m + self.spacing_m * offset)
        weight, force_n, place_m = (vote.double().cpu().numpy() for vote in votes)
        proposed = proposals(weight, force_n, place_m, self.spacing_m, self.threshold, self.most)
        beliefs = self.posterior.of(whitened.double().cpu().numpy(), proposed)
        return estimate_of(beliefs, self.answers_m)

    def _take(self, model: TouchModel) -> None:
        table, inter, error = model.table, model.table.interplay, model.error
        held: dict[str, Any] = {name: getattr(table.grid, name) for name in TABLE[:3]}
        held |= {name: getattr(table, name) for name in TABLE[3:]}
        held |= {name: getattr(inter, name) for name in INTERPLAY} | {name: getattr(error, name) for name in SURE}
        for name, value in held.items():
            tensor = torch.as_tensor(np.array(value), dtype=_kind(name))
            self.register_buffer(name, tensor)
        self.arguments["shapes"] = {name: list(np.shape(value)) for name, value in held.items()}
        self._posterior = None


def lattice_m(taxel_m: list[list[float]]) -> list[list[float]]:
    """Places half as far apart as the taxels, half a spacing beyond the outermost on every side."""
    taxels = np.array(taxel_m)
    step = 0.5 * grid_spacing_m(taxels)
    low, high = taxels.min(axis=0) - step, taxels.max(axis=0) + step
    x, y = (np.linspace(low[k], high[k], round((high[k] - low[k]) / step) + 1) for k in range(2))
    places: list[list[float]] = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2).tolist()
    return places


def _kind(name: str) -> torch.dtype:
    return torch.float32 if name in ("response", "cell_s") else torch.float64
