"""Noise as the rest frames show it: white reading noise, drift with its full covariance, spikes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from ertskin.physics.protocol import Protocol
from ertskin.physics.spikes import despiked, robust_std

Array = NDArray[np.float64]

CHANCE = 0.01
"""Of white noise alone to be taken for a direction that is known to wander."""


@dataclass(frozen=True, eq=False)
class MeasuredNoise:
    """What a frame carries against the mean rest frame.

    ``std_v``: white noise of a reading. ``drift_v`` (D,P): directions in whitened coordinates in which the rest
    baseline wanders, each scaled to one standard deviation. ``spike_rate``: chance of a reading to be a spike;
    ``spike_v`` (S,): spikes seen, drawn from again.
    """

    protocol: Protocol
    std_v: float
    drift_v: Array
    spike_rate: float
    spike_v: Array

    @classmethod
    def from_rest(
        cls,
        protocol: Protocol,
        rest_v: Array,
        slope_v: Array | None = None,
        zero: Array | None = None,
        margin: float = 2.0,
    ) -> MeasuredNoise:
        """From rest frames (T,K,M) in volt; fewer than three raise ``ValueError``.

        ``slope_v`` (P,m): by what is known to wander, as contacts and sheet. A direction found in few frames is off by
        the white noise in all the others, so what these explain, beyond chance, is measured along them. Of what is
        left a direction counts as drift when its variance over the frames exceeds what white noise alone would show in
        the largest of T-1 directions (Marchenko-Pastur edge) by ``margin``; the white part is taken off. ``zero``
        (T,T): weights of the others in the zero that each frame counts from, their mean where it isn't given; what
        they predict of a frame is no noise of its change.
        """
        if len(rest_v) < 3:
            raise ValueError(f"measured noise needs at least three rest frames, the recording has {len(rest_v)}")
        coordinates, left_out = despiked(protocol, rest_v)
        leftover = rest_v.reshape(len(rest_v), -1) - coordinates @ protocol.orthonormal.T
        usable = np.isfinite(leftover) & protocol.taken.ravel()
        flagged = left_out.reshape(len(rest_v), -1) & usable
        std_v = _white_std(protocol, leftover[usable & ~flagged], np.diff(coordinates, axis=0))
        rate = float(flagged.sum() / max(usable.sum(), 1))
        if zero is None:
            zero = (1.0 - np.eye(len(rest_v))) / (len(rest_v) - 1)
        # What a frame differs by from the mean of the others is larger than its own noise by that of the mean.
        own = (np.eye(len(zero)) - zero) / np.sqrt(1.0 + (zero**2).sum(axis=1, keepdims=True))
        centred = own @ coordinates
        slope_v = np.zeros((coordinates.shape[1], 0)) if slope_v is None else slope_v
        known, left = _along(centred, slope_v, std_v, _freedom(own))
        drift = np.concatenate([known, _drift(left, std_v, margin)])
        return cls(protocol, std_v, drift, rate, leftover[flagged])

    def coordinates(self, rng: np.random.Generator, trials: int) -> Array:
        """(trials, P) volt: white noise and drift; spikes are what the reduction takes out."""
        white = self.std_v * rng.standard_normal((trials, self.drift_v.shape[1]))
        return white + rng.standard_normal((trials, len(self.drift_v))) @ self.drift_v

    def readings(self, rng: np.random.Generator, trials: int) -> Array:
        """(trials, K*M) volt: white noise, drift and spikes, nought where no reading is taken."""
        size = (trials, self.protocol.orthonormal.shape[0])
        drift = rng.standard_normal((trials, len(self.drift_v))) @ self.drift_v
        noise = self.std_v * rng.standard_normal(size) + drift @ self.protocol.orthonormal.T
        if len(self.spike_v):
            noise += np.where(rng.random(size) < self.spike_rate, rng.choice(self.spike_v, size), 0.0)
        return np.where(self.protocol.taken.ravel(), noise, 0.0)

    @property
    def covariance_v2(self) -> Array:
        """(P,P) volt squared."""
        return self.std_v**2 * np.eye(self.drift_v.shape[1]) + self.drift_v.T @ self.drift_v


def _white_std(protocol: Protocol, leftover: Array, change: Array) -> float:
    """Noise of a reading from what no resistor network explains, corrected for the n numbers fitted per frame.

    Where no reading is taken twice, any is explained: then from the scan's own ``change`` from frame to frame.
    """
    spare = protocol.count - protocol.orthonormal.shape[1]
    if spare == 0:
        return float(robust_std(change)) / float(np.sqrt(2.0))
    return float(robust_std(leftover)) * float(np.sqrt(protocol.count / spare))


def _freedom(own: Array) -> float:
    """Degrees of freedom of a mean square over frames that are (T,T) combinations ``own`` of independent ones
    (Satterthwaite); T-1 where each counts from the mean of all others."""
    covariance = own @ own.T
    return float(np.trace(covariance) ** 2 / np.square(covariance).sum())


def _along(centred: Array, slope_v: Array, std_v: float, freedom: float) -> tuple[Array, Array]:
    """(m,P) slopes times the standard deviations of what each is of, and what (T,P) they leave of the frames; slopes
    along which white noise alone shows as much more often than by ``CHANCE`` are left out."""
    by_chance = chdtri(freedom, CHANCE) / freedom
    variance, _, _ = _variance(centred, slope_v, std_v)
    slope_v = slope_v[:, variance > by_chance]
    variance, error, coefficients = _variance(centred, slope_v, std_v)
    size = error * np.sqrt(np.maximum(variance - 1.0, 0.0))
    return size[:, None] * slope_v.T, centred - coefficients @ slope_v.T


def _variance(centred: Array, slope_v: Array, std_v: float) -> tuple[Array, Array, Array]:
    """(m,) variance of what the slopes are of, in units of what white noise makes it err by, (m,) that error and (T,m)
    what the frames tell of it."""
    inverse = np.linalg.pinv(slope_v)
    error = np.maximum(std_v * np.linalg.norm(inverse, axis=1), np.finfo(float).tiny)
    coefficients = centred @ inverse.T
    return np.square(coefficients / error).mean(axis=0), error, coefficients


def _drift(centred: Array, std_v: float, margin: float) -> Array:
    """(D,P) drift directions times their standard deviations."""
    frames, pairs = centred.shape
    _, singular, directions = np.linalg.svd(centred, full_matrices=False)
    variance = singular**2 / frames
    white = std_v**2 * (1.0 + np.sqrt(pairs / (frames - 1))) ** 2
    kept = variance > margin * white
    level = std_v**2 * (1.0 + pairs / (frames - 1))
    return np.sqrt(np.maximum(variance[kept] - level, 0.0))[:, None] * directions[kept]
