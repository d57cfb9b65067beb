"""Fading memory with one time constant, stepped exactly over uneven times for inputs linear in between."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from physics.effects.effect import Array


def relaxing(
    drive: Array,
    time_s: Array,
    constant_s: float,
    cleared: NDArray[np.bool_] | None = None,
    *,
    ramp_s: float = np.inf,
) -> Array:
    """(T,...) h with h' = drive' - h/tau, h(0) = drive(0): what of the drive (T,...) has not relaxed yet.

    A Maxwell branch under a drive linear between the times (T,), or that is there after ``ramp_s`` and stands; exact
    for any step. Where ``cleared`` (T,) the memory is empty: h = drive.
    """
    step = np.diff(time_s, prepend=time_s[0])
    ramp = np.minimum(step, ramp_s)
    decay = np.exp(-step / constant_s)
    share = ramp / constant_s
    gain = np.where(share > 0, -np.expm1(-share) / np.where(share > 0, share, 1.0), 1.0)
    gain = gain * np.exp(-(step - ramp) / constant_s)
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


def lagging(
    drive: Array,
    time_s: Array,
    constant_s: float,
    cleared: NDArray[np.bool_] | None = None,
    *,
    ramp_s: float = np.inf,
) -> Array:
    """(T,...) m with m' = (drive - m)/tau, starting at rest: what of the drive has been taken in by now.

    Where ``cleared`` (T,) nothing has: m = 0. ``ramp_s`` as of ``relaxing``.
    """
    return drive - relaxing(drive, time_s, constant_s, cleared, ramp_s=ramp_s)


def moved_within_s(time_s: Array) -> float:
    """How long a press moves between frames at times (T,): no longer than between most of them, then it stands.

    A stage sets out when a scan is over, and what is longer than usual it waits, or travels through the air.
    """
    step = np.diff(time_s)
    step = step[step > 0]
    return float(np.quantile(step, 0.25)) if step.size else np.inf
