"""Fixed transforms of a network's inputs, fitted once on its training trials and kept with its weights."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from ertskin.physics.noise.directions import nearest_directions, noise_directions

Array = NDArray[np.float64]


class Standardise(nn.Module):
    """Each input less its mean, over its standard deviation."""

    mean: Tensor
    std: Tensor

    def __init__(self, inputs: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(inputs))
        self.register_buffer("std", torch.ones(inputs))

    def fit(self, mean: Array, std: Array) -> None:
        """From (inputs,) each; one that never changes takes the largest spread: noise on it mustn't be blown up."""
        largest = float(std.max()) or 1.0
        self.mean.copy_(torch.from_numpy(mean))
        self.std.copy_(torch.from_numpy(np.where(std > 1e-6 * largest, std, largest)))

    def forward(self, values: Tensor) -> Tensor:
        """(…,inputs) to the same shape."""
        return (values - self.mean) / self.std

    def inverse(self, values: Tensor) -> Tensor:
        """Undo ``forward``."""
        return values * self.std + self.mean


class NoiseWhitening(nn.Module):
    """The strongest ``outputs`` directions of the inputs, in units of the noise.

    The inverse Cholesky factor of the noise's covariance makes the noise white: directions in which the baseline
    wanders shrink, quiet ones grow. Then the principal directions of the signal are kept; where it has none there is
    only noise. ``strength``: rms of the values it was fitted on, in units of the noise.
    """

    matrix: Tensor
    strength: Tensor

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.register_buffer("matrix", torch.eye(inputs)[:, :outputs].clone())
        self.register_buffer("strength", torch.ones(()))
        self.kept = False

    def keep(self) -> None:
        """Stay with these directions, which weights were learned for, as nearly as another noise lets."""
        self.kept = True

    def fit(self, values: Array, covariance: Array, floor: float = 1e-3) -> None:
        """From (N,inputs) clean values and the noise's covariance.

        ``floor``: least noise assumed, as a share of the values' rms; it keeps a noise-free set usable.
        """
        matrix, power = noise_directions(values, covariance, floor)
        count = self.matrix.shape[1]
        if self.kept:
            matrix = matrix @ nearest_directions(matrix, self.matrix.double().numpy())
            power = np.mean((values @ matrix) ** 2, axis=0)
        self.matrix.copy_(torch.from_numpy(matrix[:, :count]))
        self.strength.fill_(float(np.sqrt(power[:count].mean())))

    def forward(self, values: Tensor) -> Tensor:
        """(…,inputs) to (…,outputs)."""
        return values @ self.matrix
