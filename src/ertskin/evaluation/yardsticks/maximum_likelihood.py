"""The oracle: the most likely contacts under the forward model and the noise, searched over all taxels and forces."""

from __future__ import annotations

from typing import Self

import numpy as np
from scipy.linalg import solve_triangular

from ertskin.evaluation.yardsticks.forward import Indices, Response, interpolant
from ertskin.evaluation.yardsticks.yardstick import Array

FORCE_STEP_N = 0.02
FRAMES_AT_ONCE = 64
Contacts = tuple[Indices, Array, float]
"""Taxels pressed, their forces in newton, and the squared misfit in units of the noise."""


class MaximumLikelihood:
    """Up to two contacts on the taxels, by least squares in units of the noise.

    ``response``: the forward model. ``covariance_v2`` (P,P) or a scalar: noise of the whitened changes in volt squared.
    ``level_n`` (F,): forces tabulated, between which the response is a spline. The search compares all taxels, and all
    pairs of taxels at all pairs of levels by superposition; the ``candidates`` best pairs are refined by ``steps`` of
    Gauss-Newton through the full model, where contacts act on each other. The number of contacts is chosen by the
    Bayesian information criterion with the noise level unknown (Schwarz 1978), so a model that is a little wrong
    doesn't invent contacts. Nothing is learned: ``fit`` ignores its data.
    """

    name = "oracle"

    def __init__(
        self,
        response: Response,
        covariance_v2: Array | float,
        level_n: Array,
        candidates: int = 3,
        steps: int = 4,
    ):
        self.response, self.level_n = response, np.asarray(level_n, dtype=float)
        self.candidates, self.steps = candidates, steps
        table_v = response.table_v(self.level_n)
        taxels, levels, width = table_v.shape
        covariance = np.asarray(covariance_v2) if np.ndim(covariance_v2) else np.eye(width) * float(covariance_v2)
        self.noise_factor = np.linalg.cholesky(covariance)
        self.table = self._in_noise(table_v.reshape(-1, width)).reshape(taxels, levels, width)
        taxel = np.repeat(np.arange(taxels), levels)
        flat = self.table.reshape(-1, width)
        same = taxel[:, None] == taxel
        self.pair_term = 2.0 * flat @ flat.T
        self.pair_term[same] = np.inf
        fine_n = np.arange(0.0, self.level_n[-1], FORCE_STEP_N)
        self.fine_n, self.fine = fine_n, interpolant(self.level_n, self.table)(fine_n)
        self.fine_square = np.einsum("fnp,fnp->fn", self.fine, self.fine)

    def fit(self, change_v: Array, force_map_n: Array) -> Self:
        """Does nothing: the oracle knows the physics already."""
        return self

    def predict(self, change_v: Array) -> Array:
        """(N,n) newton of the most likely contacts."""
        changes = self._in_noise(change_v)
        parts = [changes[first : first + FRAMES_AT_ONCE] for first in range(0, len(changes), FRAMES_AT_ONCE)]
        maps = [self._best_map_n(row, one) for part in parts for row, one in zip(part, self._ones(part), strict=True)]
        return np.stack(maps)

    def _in_noise(self, change_v: Array) -> Array:
        """Changes (N,P) in units of the noise: unit white."""
        return solve_triangular(self.noise_factor, change_v.T, lower=True).T

    def _best_map_n(self, change: Array, one: Contacts) -> Array:
        """(n,) the map with the least information criterion among no, one (``one``) and two contacts."""
        nothing = (np.array([], dtype=np.intp), np.array([]), float(change @ change))
        found = [nothing, one]
        pairs = self._pairs(change)
        if min(self._criterion(pair, change) for pair in pairs) < self._criterion(one, change):
            found += self._refined(change, pairs)
        taxel, force_n, _ = min(found, key=lambda contacts: self._criterion(contacts, change))
        best_n = np.zeros(len(self.response.taxel_m))
        best_n[taxel] = force_n
        return best_n

    @staticmethod
    def _criterion(contacts: Contacts, change: Array) -> float:
        """Bayesian information criterion with a place and a force per contact and one unknown noise level."""
        taxel, _, squares = contacts
        return len(change) * np.log(squares / len(change)) + 2 * len(taxel) * np.log(len(change))

    def _ones(self, changes: Array) -> list[Contacts]:
        """The best single taxel for each of some changes (N,P), which together cost little more than one."""
        forces, taxels, width = self.fine.shape
        along = self.fine.reshape(-1, width) @ changes.T
        misfit = self.fine_square[..., None] - 2.0 * along.reshape(forces, taxels, -1)
        return [self._one(change, misfit[..., k]) for k, change in enumerate(changes)]

    def _one(self, change: Array, misfit: Array) -> Contacts:
        """The least of the finely interpolated table's ``misfit`` (F,n), by a parabola through three forces."""
        level, taxel = divmod(int(misfit.argmin()), misfit.shape[1])
        squares, force_n = misfit[level, taxel], self.fine_n[level]
        if 0 < level < len(self.fine_n) - 1:
            before, after = misfit[level - 1, taxel], misfit[level + 1, taxel]
            shift = 0.5 * (before - after) / (before - 2 * squares + after)
            force_n += shift * FORCE_STEP_N
            squares -= 0.25 * (before - after) * shift
        return np.array([taxel]), np.array([force_n]), float(change @ change + squares)

    def _pairs(self, change: Array) -> list[Contacts]:
        """The best pairs of taxels, each at its best pair of tabulated forces, by superposition."""
        taxels, levels, width = self.table.shape
        flat = self.table.reshape(-1, width)
        alone = np.einsum("ip,ip->i", flat, flat) - 2.0 * flat @ change
        misfit = (alone[:, None] + alone + self.pair_term).reshape(taxels, levels, taxels, levels)
        by_pair = misfit.min(axis=(1, 3))
        first, second = np.triu_indices(taxels, 1)
        order = np.argsort(by_pair[first, second])[: self.candidates]
        pairs = []
        for one, other in zip(first[order], second[order], strict=True):
            level = divmod(int(misfit[one, :, other].argmin()), levels)
            squares = float(change @ change + by_pair[one, other])
            pairs.append((np.array([one, other]), self.level_n[list(level)], squares))
        return pairs

    def _refined(self, change: Array, pairs: list[Contacts]) -> list[Contacts]:
        """Gauss-Newton in the forces through the full model, keeping forces within 0 and the last level."""
        taxel = np.stack([pair[0] for pair in pairs])
        force_n = np.stack([pair[1] for pair in pairs])
        best_n, best = force_n.copy(), np.full(len(pairs), np.inf)
        shifts_n = np.vstack([np.zeros(2), FORCE_STEP_N * np.eye(2)])
        for _ in range(self.steps):
            trials_n = (force_n[:, None] + shifts_n).reshape(-1, 2)
            said = self._in_noise(self.response.change_v(np.repeat(taxel, 3, axis=0), trials_n))
            said = said.reshape(len(pairs), 3, -1)
            residual = change - said[:, 0]
            squares = np.einsum("kp,kp->k", residual, residual)
            better = squares < best
            best_n[better], best[better] = force_n[better], squares[better]
            slope = (said[:, 1:] - said[:, :1]) / FORCE_STEP_N
            step_n = [np.linalg.lstsq(s.T, r, rcond=None)[0] for s, r in zip(slope, residual, strict=True)]
            force_n = np.clip(force_n + np.array(step_n), 0.0, self.level_n[-1])
        return list(zip(taxel, best_n, best.tolist(), strict=True))
