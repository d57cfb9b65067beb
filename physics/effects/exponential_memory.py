"""Fading memory with one time constant, stepped exactly over uneven times for inputs linear in between."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from physics.effects.effect import Array

AIR = 0.01
"""Part of the drive before or after a step that is as good as none."""


def relaxing(
    drive: Array,
    time_s: Array,
    constant_s: float,
    cleared: NDArray[np.bool_] | None = None,
    *,
    moves_s: float = np.inf,
) -> Array:
    """(T,...) h with h' = drive' - h/tau, h(0) = drive(0): what of the drive (T,...) has not relaxed yet.

    A Maxwell branch under a drive linear between the times (T,); exact for any step. A drive that leaves for nothing
    does so within the first ``moves_s`` of a step, one that comes from nothing within the last. Where ``cleared`` (T,)
    the memory is empty: h = drive.
    """
    step = np.diff(time_s, prepend=time_s[0])
    moving = np.minimum(step, moves_s)
    standing = np.exp(-(step - moving) / constant_s)
    coming = _ramped(moving / constant_s)
    gains = np.stack([_ramped(step / constant_s), coming * standing, coming])
    forget = np.zeros(len(drive), dtype=np.bool_) if cleared is None else cleared
    memory = np.empty_like(drive)
    flat = np.ascontiguousarray(drive).reshape(len(drive), -1)
    _step(memory.reshape(len(drive), -1), flat, np.exp(-step / constant_s), gains, forget)
    return memory


def _ramped(share: Array) -> Array:
    """What is left at the end of a rise by one that takes this share (T,) of the time constant."""
    return np.where(share > 0, -np.expm1(-share) / np.where(share > 0, share, 1.0), 1.0)


@njit(cache=True, nogil=True)
def _step(memory, drive, decay, gains, forget):  # type: ignore[no-untyped-def]
    memory[0] = drive[0]
    for t in range(1, len(drive)):
        for n in range(drive.shape[1]):
            if forget[t]:
                memory[t, n] = drive[t, n]
                continue
            before, now = abs(drive[t - 1, n]), abs(drive[t, n])
            way = 1 if now < AIR * before else 2 if before < AIR * now else 0
            memory[t, n] = decay[t] * memory[t - 1, n] + gains[way, t] * (drive[t, n] - drive[t - 1, n])


def lagging(
    drive: Array,
    time_s: Array,
    constant_s: float,
    cleared: NDArray[np.bool_] | None = None,
    *,
    moves_s: float = np.inf,
) -> Array:
    """(T,...) m with m' = (drive - m)/tau, starting at rest: what of the drive has been taken in by now.

    Where ``cleared`` (T,) nothing has: m = 0. ``moves_s`` as of ``relaxing``.
    """
    return drive - relaxing(drive, time_s, constant_s, cleared, moves_s=moves_s)


def moves_within_s(time_s: Array) -> float:
    """How long a press takes to come or go, where frames are at times (T,): no longer than most steps between them.

    A stage leaves when its last scan is over and lands before the next one; what is longer it spends in the air.
    """
    step = np.diff(time_s)
    step = step[step > 0]
    return float(np.quantile(step, 0.25)) if step.size else np.inf
