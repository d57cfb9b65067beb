"""Predict the mean training map, whatever the readings: the least a method must beat."""

from __future__ import annotations

from typing import Self

import numpy as np

from ertskin.evaluation.yardsticks.yardstick import Array


class Mean:
    """The mean force map."""

    name = "mean"

    def fit(self, change_v: Array, force_map_n: Array) -> Self:
        """Takes the mean of ``force_map_n`` (N,n); the readings aren't looked at."""
        self.map_n_ = force_map_n.mean(axis=0)
        return self

    def predict(self, change_v: Array) -> Array:
        """(N,n) the same map for every row."""
        return np.tile(self.map_n_, (len(change_v), 1))
