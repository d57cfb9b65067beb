"""No noise at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NoNoise:
    """Clean readings."""

    protocol: Protocol

    def coordinates(self, rng: np.random.Generator, trials: int) -> Array:
        """(trials, P) zeros."""
        return np.zeros((trials, self.protocol.orthonormal.shape[1]))

    def readings(self, rng: np.random.Generator, trials: int) -> Array:
        """(trials, K*M) zeros."""
        return np.zeros((trials, self.protocol.orthonormal.shape[0]))

    @property
    def covariance_v2(self) -> Array:
        """(P,P) zeros."""
        pairs = self.protocol.orthonormal.shape[1]
        return np.zeros((pairs, pairs))
