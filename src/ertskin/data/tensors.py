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
