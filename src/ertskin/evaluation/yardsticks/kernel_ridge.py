"""Ridge regression in the feature space of a Gaussian kernel (Saunders et al. 1998), tuned on held-out forces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np
from scipy.sparse.linalg import eigsh
from scipy.spatial.distance import cdist, pdist, squareform

from ertskin.evaluation.yardsticks.held_out_regime import Indices, force_bands
from ertskin.evaluation.yardsticks.yardstick import Array

WIDTHS = (0.3, 1.0, 3.0, 10.0)
POWERS = (0.5, 1.0)
PENALTIES = tuple(10.0 ** np.arange(-8.0, 1.0))


class KernelRidge:
    """Kernel ridge regression from changes to force maps.

    Candidates: ``widths`` of the kernel as multiples of the median distance between rows, ``powers`` p of the
    transform sign(x)|x|^p that brings weak and strong presses closer, ``penalties`` as a share of the kernel's largest
    eigenvalue. Solving is cubic in the rows: at most ``rows`` of them are kept for the fit and ``tuning_rows`` for
    tuning, drawn with ``seed``.
    """

    name = "kernel ridge"

    def __init__(
        self,
        widths: Sequence[float] = WIDTHS,
        powers: Sequence[float] = POWERS,
        penalties: Sequence[float] = PENALTIES,
        rows: int = 3000,
        tuning_rows: int = 800,
        seed: int = 0,
    ):
        self.widths, self.powers, self.penalties = widths, powers, penalties
        self.rows, self.tuning_rows, self.seed = rows, tuning_rows, seed

    def fit(self, change_v: Array, force_map_n: Array) -> Self:
        """Picks width, power and penalty with the least squared error on held-out force bands, then fits ``rows``."""
        order = np.random.default_rng(self.seed).permutation(len(change_v))
        few = order[: self.tuning_rows]
        bands = list(force_bands(force_map_n[few]))
        tuned = []
        for power in self.powers:
            features, _ = self._features(change_v[few], power)
            squares = squareform(pdist(features, "sqeuclidean"))
            for width in self.widths:
                errors = self._errors(np.exp(-0.5 * squares / width**2), force_map_n[few], bands)
                tuned.append((*min(zip(errors, self.penalties, strict=True)), width, power))
        _, self.penalty_, self.width_, self.power_ = min(tuned)
        kept = order[: self.rows]
        self.features_, self.scale_ = self._features(change_v[kept], self.power_)
        self.offset_n_ = force_map_n[kept].mean(axis=0)
        kernel = np.exp(-0.5 * squareform(pdist(self.features_, "sqeuclidean")) / self.width_**2)
        # Entries are positive, so the vector that starts the iteration can't miss the largest one's.
        largest = float(eigsh(kernel, k=1, v0=np.ones(len(kept)), return_eigenvectors=False)[0])
        kernel[np.diag_indices_from(kernel)] += self.penalty_ * largest
        self.weight_ = np.linalg.solve(kernel, force_map_n[kept] - self.offset_n_)
        return self

    def predict(self, change_v: Array) -> Array:
        """(N,n) newton; may be negative."""
        features = _power(change_v, self.power_) / self.scale_
        return self._kernel(features, self.width_) @ self.weight_ + self.offset_n_

    def _features(self, change_v: Array, power: float) -> tuple[Array, float]:
        """Transformed rows scaled so that their median distance is 1, and the scale."""
        raised = _power(change_v, power)
        scale = float(np.median(pdist(raised[: self.tuning_rows])))
        return raised / scale, scale

    def _kernel(self, features: Array, width: float) -> Array:
        """(N,rows) Gaussian kernel against the rows being fitted."""
        return np.exp(-0.5 * cdist(features, self.features_, "sqeuclidean") / width**2)

    def _errors(self, kernel: Array, force_map_n: Array, bands: Sequence[tuple[Indices, Indices]]) -> list[float]:
        """Squared error on the held-out ``bands`` for every penalty, each from one eigendecomposition."""
        errors = np.zeros(len(self.penalties))
        for train, test in bands:
            offset_n = force_map_n[train].mean(axis=0)
            eigenvalue, vector = np.linalg.eigh(kernel[np.ix_(train, train)])
            projected = vector.T @ (force_map_n[train] - offset_n)
            across = kernel[np.ix_(test, train)] @ vector
            for index, penalty in enumerate(self.penalties):
                damped = np.maximum(eigenvalue, 0.0) + penalty * eigenvalue[-1]
                errors[index] += np.sum((across @ (projected / damped[:, None]) + offset_n - force_map_n[test]) ** 2)
        return errors.tolist()


def _power(change_v: Array, power: float) -> Array:
    return np.sign(change_v) * np.abs(change_v) ** power
