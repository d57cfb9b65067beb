"""The one interface of all yardsticks."""

from __future__ import annotations

from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Yardstick(Protocol):
    """A method to compare with: changes in, force maps out."""

    name: str

    def fit(self, change_v: Array, force_map_n: Array) -> Self:
        """Learn from (N,P) whitened changes in volt and (N,n) force maps in newton; tunes itself on these alone."""
        ...

    def predict(self, change_v: Array) -> Array:
        """(N,n) force maps in newton of (N,P) whitened changes in volt."""
        ...
