"""What every noise model answers."""

from __future__ import annotations

from typing import Protocol as Interface

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Noise(Interface):
    """Noise of a voltage change, in the P whitened coordinates or in the raw readings (``physics/protocol.py``)."""

    def coordinates(self, rng: np.random.Generator, trials: int) -> Array:
        """(trials, P) volt to add to whitened coordinates, spikes already removed as the reader would."""
        ...

    def readings(self, rng: np.random.Generator, trials: int) -> Array:
        """(trials, K*M) volt to add to raw readings, spikes included."""
        ...

    @property
    def covariance_v2(self) -> Array:
        """(P,P) covariance of ``coordinates``."""
        ...
