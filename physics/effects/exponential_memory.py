"""Fading memory with one time constant, stepped exactly over uneven times for inputs linear in between."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from physics.effects.effect import Array


def relaxing(drive: Array, time_s: Array, constant_s: float, cleared: NDArray[np.bool_] | None = None) -> Array:
    """(T,...) h with h' = drive' - h/tau, h(0) = drive(0): what of the drive (T,...) has not relaxed yet.

    A Maxwell branch under a drive linear between the times (T,); exact for any step. Where ``cleared`` (T,) the memory
    is empty: h = drive.
    """
    step = np.diff(time_s, prepend=time_s[0])
    decay = np.exp(-step / constant_s)
    gain = np.where(step > 0, (1 - decay) * constant_s / np.where(step > 0, step, 1.0), 1.0)
    forget = np.zeros(len(drive), dtype=np.bool_) if cleared is None else cleared
    memory = np.empty_like(drive)
    _step(memory.reshape(len(drive), -1), np.ascontiguousarray(drive).reshape(len(drive), -1), decay, gain, forget)
    return memory


@njit(cache=True, nogil=True)
def _step(memory, drive, decay, gain, forget):  # type: ignore[no-untyped-def]
    memory[0] = drive[0]
    for t in range(1, len(drive)):
        for n in range(drive.shape[1]):
            if forget[t]:
                memory[t, n] = drive[t, n]
                continue
            memory[t, n] = decay[t] * memory[t - 1, n] + gain[t] * (drive[t, n] - drive[t - 1, n])


def lagging(drive: Array, time_s: Array, constant_s: float, cleared: NDArray[np.bool_] | None = None) -> Array:
    """(T,...) m with m' = (drive - m)/tau, starting at rest: what of the drive has been taken in by now.

    Where ``cleared`` (T,) nothing has: m = 0.
    """
    return drive - relaxing(drive, time_s, constant_s, cleared)
