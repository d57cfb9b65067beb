"""Smooth random maps over the sheet: how things vary from place to place in a hand-made skin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def gaussian_field(points_m: Array, seed: int, length_m: float = 0.045, terms: int = 60) -> Array:
    """(...,) zero-mean field of unit variance at points (...,2): random plane waves of a Gaussian spectrum."""
    rng = np.random.default_rng(seed)
    wave = rng.normal(0.0, 1.0 / length_m, (terms, 2))
    phase = rng.uniform(0.0, 2 * np.pi, terms)
    total = np.zeros(points_m.shape[:-1])
    for k, shift in zip(wave, phase, strict=True):
        total += np.cos(points_m @ k + shift)
    return total * np.sqrt(2.0 / terms)


def patch(points_m: Array, center_m: Array, radius_m: float, edge_m: float) -> Array:
    """(...,) one inside a disc, nought outside, logistic over ``edge_m`` at its rim."""
    distance = np.hypot(points_m[..., 0] - center_m[0], points_m[..., 1] - center_m[1])
    return 1.0 / (1.0 + np.exp(np.clip((distance - radius_m) / edge_m, -60.0, 60.0)))
