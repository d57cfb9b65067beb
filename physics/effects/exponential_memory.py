"""Fading memory with one time constant, stepped exactly over uneven times for inputs linear in between."""

from __future__ import annotations

import numpy as np

from physics.effects.effect import Array


def relaxing(drive: Array, time_s: Array, constant_s: float) -> Array:
    """(T,...) h with h' = drive' - h/tau, h(0) = drive(0): what of the drive (T,...) has not relaxed yet.

    A Maxwell branch under a drive linear between the times (T,); exact for any step.
    """
    step = np.diff(time_s, prepend=time_s[0])
    decay = np.exp(-step / constant_s)
    gain = np.where(step > 0, (1 - decay) * constant_s / np.where(step > 0, step, 1.0), 1.0)
    memory = np.empty_like(drive)
    memory[0] = drive[0]
    for t in range(1, len(drive)):
        memory[t] = decay[t] * memory[t - 1] + gain[t] * (drive[t] - drive[t - 1])
    return memory


def lagging(drive: Array, time_s: Array, constant_s: float) -> Array:
    """(T,...) m with m' = (drive - m)/tau, starting at rest: what of the drive has been taken in by now."""
    start = np.zeros_like(drive[:1])
    padded = np.concatenate([start, drive])
    times = np.concatenate([time_s[:1], time_s])
    return drive - relaxing(padded, times, constant_s)[1:]
