"""Linear regression with a quadratic penalty (Hoerl and Kennard 1970), tuned on held-out forces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from ertskin.evaluation.yardsticks.held_out_regime import force_bands
from ertskin.evaluation.yardsticks.yardstick import Array

PENALTIES = tuple(10.0 ** np.arange(-10.0, 1.0))


class Ridge:
    """Ridge regression from changes to force maps.

    ``penalties``: candidates, as a share of the largest eigenvalue of the changes' covariance.
    """

    name = "ridge"

    def __init__(self, penalties: Sequence[float] = PENALTIES):
        self.penalties = penalties

    def fit(self, change_v: Array, force_map_n: Array) -> Self:
        """Picks the penalty with the least squared error on held-out force bands, then fits all rows."""
        error = np.zeros(len(self.penalties))
        for train, test in force_bands(force_map_n):
            maps = self._solve(change_v[train], force_map_n[train])
            for index, (weight, offset_n) in enumerate(maps):
                error[index] += np.sum((change_v[test] @ weight + offset_n - force_map_n[test]) ** 2)
        best = int(error.argmin())
        self.penalty_ = float(self.penalties[best])
        self.weight_, self.offset_n_ = self._solve(change_v, force_map_n)[best]
        return self

    def predict(self, change_v: Array) -> Array:
        """(N,n) newton; may be negative."""
        return change_v @ self.weight_ + self.offset_n_

    def _solve(self, change_v: Array, force_map_n: Array) -> list[tuple[Array, Array]]:
        """Weights (P,n) and offsets (n,) for every penalty, from one eigendecomposition."""
        centre_v, centre_n = change_v.mean(axis=0), force_map_n.mean(axis=0)
        centred = change_v - centre_v
        eigenvalue, vector = np.linalg.eigh(centred.T @ centred)
        projected = vector.T @ (centred.T @ (force_map_n - centre_n))
        weights = [
            vector @ (projected / (np.maximum(eigenvalue, 0.0) + penalty * eigenvalue[-1])[:, None])
            for penalty in self.penalties
        ]
        return [(weight, centre_n - centre_v @ weight) for weight in weights]
