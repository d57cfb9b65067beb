"""An ensemble of small networks from 192 responses to a place, its members trained side by side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from kernel_ridge import compressed
from numpy.typing import NDArray
from torch import Tensor, nn

Array = NDArray[np.float64]
HALF_SIZE_MM = 40.0


@dataclass(frozen=True)
class Settings:
    """``scale`` of the compression asinh(x/s); ``members`` networks of three hidden layers of ``width`` units, with
    ``dropout``; ``epochs`` of AdamW with batches of ``batch``, one cycle of the learning rate up to ``rate``."""

    scale: float = 1000.0
    dropout: float = 0.1
    epochs: int = 300
    members: int = 5
    width: int = 256
    batch: int = 64
    rate: float = 2e-3
    decay: float = 1e-2


class SideBySide(nn.Module):
    """``members`` dense layers in one product: (members, N, inputs) to (members, N, outputs)."""

    def __init__(self, members: int, inputs: int, outputs: int, generator: torch.Generator):
        super().__init__()
        reach = inputs**-0.5
        self.weight = nn.Parameter(reach * (2 * torch.rand(members, inputs, outputs, generator=generator) - 1))
        self.bias = nn.Parameter(reach * (2 * torch.rand(members, 1, outputs, generator=generator) - 1))

    def forward(self, values: Tensor) -> Tensor:
        """Each member's own affine map."""
        return torch.baddbmm(self.bias, values, self.weight)


def _ensemble(inputs: int, settings: Settings, generator: torch.Generator) -> nn.Sequential:
    layers: list[nn.Module] = []
    for number in range(3):
        wide = settings.width if number else inputs
        layers += [SideBySide(settings.members, wide, settings.width, generator), nn.GELU()]
        layers += [nn.Dropout(settings.dropout)] if number < 2 else []
    return nn.Sequential(*layers, SideBySide(settings.members, settings.width, 2, generator))


def fit_predict(response: Array, place_mm: Array, asked: Array, settings: Settings, seed: int) -> Array:
    """(M,2) places in mm for responses ``asked`` (M,192), learned from ``response`` (N,192) at ``place_mm`` (N,2).

    The ensemble's answer is the mean of its members'.
    """
    return fitted(response, place_mm, settings, seed).places_mm(asked)


@dataclass(frozen=True, eq=False)
class Learned:
    """A trained ensemble, and what its inputs were scaled by."""

    network: nn.Sequential
    settings: Settings
    mean: Array
    spread: Array
    centre_mm: Array

    def places_mm(self, asked: Array) -> Array:
        """(M,2) places in mm for responses (M,192): the mean of the members' answers."""
        with torch.no_grad():
            scaled = (compressed(asked, self.settings.scale) - self.mean) / self.spread
            question = torch.from_numpy(scaled).float()
            said = self.network(question.expand(self.settings.members, -1, -1)).mean(dim=0)
        return np.asarray(said.double().numpy() * HALF_SIZE_MM + self.centre_mm)


def fitted(response: Array, place_mm: Array, settings: Settings, seed: int, start: Learned | None = None) -> Learned:
    """An ensemble learned from ``response`` (N,192) at ``place_mm`` (N,2), from the weights of ``start`` where given.

    The loss is quadratic within 2 mm and linear beyond, so that a few wild touches don't lead.
    """
    torch.manual_seed(seed)
    generator = torch.Generator().manual_seed(seed)
    raw = compressed(response, settings.scale)
    mean, spread = raw.mean(axis=0), raw.std(axis=0)
    inputs = torch.from_numpy((raw - mean) / spread).float()
    centre_mm = place_mm.mean(axis=0)
    target = torch.from_numpy((place_mm - centre_mm) / HALF_SIZE_MM).float()
    network = _ensemble(inputs.shape[1], settings, generator)
    if start is not None:
        network.load_state_dict(start.network.state_dict())
    steps = settings.epochs * (len(inputs) // settings.batch)
    optimizer = torch.optim.AdamW(network.parameters(), lr=settings.rate, weight_decay=settings.decay, fused=True)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, settings.rate, total_steps=steps)
    for _ in range(settings.epochs):
        order = torch.stack([torch.randperm(len(inputs), generator=generator) for _ in range(settings.members)])
        for rows in order[:, : len(inputs) // settings.batch * settings.batch].split(settings.batch, dim=1):
            # Summed over the members: each gets the gradient it would have alone.
            apart = nn.functional.smooth_l1_loss(network(inputs[rows]), target[rows], beta=0.05, reduction="none")
            loss = apart.mean(dim=(1, 2)).sum()
            optimizer.zero_grad(set_to_none=True)
            loss.backward()
            optimizer.step()
            schedule.step()
    return Learned(network.eval(), settings, mean, spread, centre_mm)
