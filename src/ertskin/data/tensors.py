"""Trials as tensors on the training device, and the noise they are given."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(eq=False)
class TrialTensors:
    """N trials ready to be learned from; every tensor lies on one device, float32.

    ``inputs`` (N,D); ``targets`` name -> (N,...); ``noise`` (B,D): a bank of noise of which every trial gets one row,
    drawn anew each epoch, or None.
    """

    inputs: Tensor
    targets: dict[str, Tensor]
    noise: Tensor | None = None

    def __len__(self) -> int:
        return len(self.inputs)

    def to(self, device: torch.device) -> TrialTensors:
        """The same trials on another device."""
        noise = None if self.noise is None else self.noise.to(device)
        return TrialTensors(self.inputs.to(device), {k: v.to(device) for k, v in self.targets.items()}, noise)


@dataclass
class Batches:
    """Consecutive mini-batches: ``inputs`` (m*batch, D) and ``targets`` beside them; the last batch may be short."""

    inputs: Tensor
    targets: dict[str, Tensor]
    batch: int

    def __iter__(self):
        """Yields (inputs, targets) of each mini-batch; a last batch of one trial is left out: it has no statistics."""
        pieces = [self.inputs.split(self.batch), *(value.split(self.batch) for value in self.targets.values())]
        for inputs, *targets in zip(*pieces, strict=True):
            if len(inputs) > 1:
                yield inputs, dict(zip(self.targets, targets, strict=True))
