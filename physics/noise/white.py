"""The same independent Gaussian noise on every reading."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class WhiteNoise:
    """``std_v``: standard deviation of each reading; the orthonormal coordinates keep it."""

    protocol: Protocol
    std_v: float

    def coordinates(self, rng: np.random.Generator, trials: int) -> Array:
        """(trials, P) volt."""
        return self.std_v * rng.standard_normal((trials, self.protocol.orthonormal.shape[1]))

    def readings(self, rng: np.random.Generator, trials: int) -> Array:
        """(trials, K*M) volt."""
        noise = self.std_v * rng.standard_normal((trials, self.protocol.orthonormal.shape[0]))
        return np.where(self.protocol.taken.ravel(), noise, 0.0)

    @property
    def covariance_v2(self) -> Array:
        """(P,P) volt squared."""
        return self.std_v**2 * np.eye(self.protocol.orthonormal.shape[1])
