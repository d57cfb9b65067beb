"""The paper's noise: Gaussian per reading, modelled from real minus simulated one-point trials (IV-B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GaussianNoise:
    """``mean_v``, ``std_v`` (K*M,): moments of each reading's residual over the real one-point trials.

    The paper gives no more than "Gaussian noise modeled from the real one-point contact data"; independent readings
    with their own mean and spread are assumed.
    """

    protocol: Protocol
    mean_v: Array
    std_v: Array

    @classmethod
    def from_residuals(cls, protocol: Protocol, residual_v: Array) -> GaussianNoise:
        """From residuals (trials, K, M) in volt; at least two trials, else ``ValueError``."""
        if len(residual_v) < 2:
            raise ValueError(
                f"gaussian noise needs at least two real trials to be modelled from, got {len(residual_v)}"
            )
        flat = residual_v.reshape(len(residual_v), -1)
        return cls(protocol, flat.mean(axis=0), flat.std(axis=0, ddof=1))

    def coordinates(self, rng: np.random.Generator, trials: int) -> Array:
        """(trials, P) volt."""
        basis = self.protocol.orthonormal
        spread = rng.standard_normal((trials, basis.shape[1])) @ np.linalg.cholesky(self.covariance_v2).T
        return self.mean_v @ basis + spread

    def readings(self, rng: np.random.Generator, trials: int) -> Array:
        """(trials, K*M) volt."""
        return self.mean_v + self.std_v * rng.standard_normal((trials, len(self.std_v)))

    @property
    def covariance_v2(self) -> Array:
        """(P,P) volt squared."""
        basis = self.protocol.orthonormal
        return basis.T @ (self.std_v[:, None] ** 2 * basis)
