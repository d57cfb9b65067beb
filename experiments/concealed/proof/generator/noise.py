"""Noise of readings, load cell and converter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .protocol import Protocol
from .skin import Noise

Array = NDArray[np.float64]


def readings(voltage_v: Array, noise: Noise, rng: np.random.Generator) -> Array:
    """(T,K,M) with white noise and, of the same variance in all, an autoregressive part from injection to injection."""
    white = rng.standard_normal(voltage_v.shape)
    slow = np.empty_like(voltage_v).reshape(-1, voltage_v.shape[2])
    if noise.coloured_share > 0:
        kick = rng.standard_normal(slow.shape)
        slow[0] = kick[0]
        for i in range(1, len(slow)):
            slow[i] = 0.98 * slow[i - 1] + np.sqrt(1 - 0.98**2) * kick[i]
        white = np.sqrt(1 - noise.coloured_share) * white + np.sqrt(noise.coloured_share) * slow.reshape(white.shape)
    return np.asarray(voltage_v + noise.white_v * white)


def converted(voltage_v: Array, protocol: Protocol) -> Array:
    """As the converter says: whole counts, no further than its limit."""
    step, limit = protocol.adc_volts_per_count, protocol.adc_limit_v
    return np.asarray(step * np.round(np.clip(voltage_v, -limit, limit) / step))
