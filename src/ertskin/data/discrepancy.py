"""What the real skin does beyond the simulator, learned per taxel from real presses and added to simulated ones.

A function of the force for each recorded place (Kennedy & O'Hagan, J. R. Stat. Soc. B 63 (2001) 425: a Gaussian process
for the discrepancy of a computer model). It has no name and explains nothing; a diagnosis does. Discrepancies of
several contacts add up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular

Array = NDArray[np.float64]

LENGTHS = (0.3, 0.6, 1.2)
SIGNALS = tuple(10.0**k for k in range(-1, 6))
LEAST_NOISE = 1e-6
"""Variance of the noise assumed at least, as a share of the residuals' own: it keeps a noise-free set usable."""


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """Gaussian-process mean of real minus simulated change at each recorded place.

    ``place_m`` (n,2); per place the forces (f,) seen and the weights (f,P) of the process; ``length``: correlation
    length in log(1 + F/N). ``reach_m``: contacts further than this from every recorded place get none.
    """

    place_m: Array
    force_n: list[Array]
    weight_v: list[Array]
    length: float
    reach_m: float

    @classmethod
    def fit(
        cls,
        contact_m: Array,
        force_n: Array,
        simulated_v: Array,
        residual_v: Array,
        covariance_v2: Array,
        reach_m: float,
    ) -> Discrepancy:
        """From one-point presses: places (N,2), forces (N,), simulated changes (N,P), what the real ones have beyond
        them (N,P), both whitened coordinates in volt, and the real ones' noise (P,P).

        All is seen in units of the noise, so that what wanders anyway isn't taken for the skin's doing. At each place
        only directions that matter are kept (``_directions``): noise kept in the others would be the same in every
        trial made from it, and a network would learn to read the force off it. Length and size of the process are
        those of the largest marginal likelihood, common to all places.
        """
        place, number = np.unique(contact_m, axis=0, return_inverse=True)
        groups = [np.flatnonzero(number.ravel() == k) for k in range(len(place))]
        least = LEAST_NOISE * np.mean(residual_v**2)
        noise = np.linalg.cholesky(covariance_v2 + least * np.eye(len(covariance_v2)))
        simulated, residual = (solve_triangular(noise, v.T, lower=True).T for v in (simulated_v, residual_v))
        bases = [_directions(simulated[rows], residual[rows]) for rows in groups]
        sets = [(force_n[rows], residual[rows] @ basis) for rows, basis in zip(groups, bases, strict=True)]
        length, signal = max(
            ((length, signal) for length in LENGTHS for signal in SIGNALS),
            key=lambda choice: sum(_evidence(f, r, *choice) for f, r in sets),
        )
        weights = [
            signal * cho_solve(cho_factor(signal * _kernel(f, f, length) + np.eye(len(f))), r) @ (noise @ basis).T
            for (f, r), basis in zip(sets, bases, strict=True)
        ]
        return cls(place, [f for f, _ in sets], weights, length, reach_m)

    def of(self, contact_m: Array, force_n: Array) -> Array:
        """(N,P) volt to add to the simulated change of contacts (N,C,2) with forces (N,C); NaN: no contact."""
        total = np.zeros((len(force_n), self.weight_v[0].shape[1]))
        away = np.linalg.norm(contact_m[:, :, None] - self.place_m, axis=-1)
        away = np.where(np.isfinite(away), away, np.inf)
        for k in range(len(self.place_m)):
            rows, slots = np.nonzero((away.argmin(axis=-1) == k) & (away.min(axis=-1) <= self.reach_m))
            if len(rows):
                found = _kernel(force_n[rows, slots], self.force_n[k], self.length) @ self.weight_v[k]
                np.add.at(total, rows, found)
        return total


def _directions(simulated: Array, residual: Array) -> Array:
    """(P,d) orthonormal directions kept of one place's presses (f,P), given in units of the noise.

    Those in which the simulated response itself exceeds the noise, known without error, and beyond them those in which
    the residuals rise above the largest that noise alone would give (Marchenko-Pastur edge).
    """
    _, strength, own = np.linalg.svd(simulated, full_matrices=False)
    own = own[strength > 1.0]
    _, strength, beyond = np.linalg.svd(residual - residual @ own.T @ own, full_matrices=False)
    edge = np.sqrt(residual.shape[1]) + np.sqrt(len(residual))
    return np.concatenate([own, beyond[strength > edge]]).T


def _kernel(a_n: Array, b_n: Array, length: float) -> Array:
    """Covariance of the discrepancy at two forces: smooth in log(1 + F/N), nothing without force."""
    u, v = np.log1p(np.maximum(a_n, 0.0))[:, None], np.log1p(np.maximum(b_n, 0.0))
    return u * v * np.exp(-0.5 * ((u - v) / length) ** 2)


def _evidence(force_n: Array, residual: Array, length: float, signal: float) -> float:
    """Log marginal likelihood of residuals in units of the noise, as is ``signal``, a variance."""
    factor, lower = cho_factor(signal * _kernel(force_n, force_n, length) + np.eye(len(force_n)))
    quadratic = np.sum(residual * cho_solve((factor, lower), residual))
    return float(-0.5 * quadratic - residual.shape[1] * np.log(np.diag(factor)).sum())
