"""Fading memory with one time constant, stepped exactly over uneven times for inputs linear in between."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.physics.effects.effect import Array

AIR = 0.01
"""Part of the drive before or after a step that is as good as none."""


@lru_cache(maxsize=8)
def _decay_and_gains(times: bytes, constants: bytes, moves_s: float) -> tuple[Array, Array]:
    """What a step leaves of each memory (K,T), and what it takes in (K,3,T) of a drive that changes over all of the
    step, at its beginning or at its end.

    Of the bytes of times (T,) and constants (K,) in seconds: remembered, for whoever solves for the drive asks many
    times.
    """
    time_s, constants_s = np.frombuffer(times), np.frombuffer(constants)
    step = np.diff(time_s, prepend=time_s[0])
    moving = np.minimum(step, moves_s)
    constant_s = constants_s[:, None]
    coming = _ramped(moving / constant_s)
    leaving = coming * np.exp(-(step - moving) / constant_s)
    return np.exp(-step / constant_s), np.stack([_ramped(step / constant_s), leaving, coming], axis=1)


def _forgets(drive: Array, cleared: NDArray[np.bool_] | None) -> NDArray[np.bool_]:
    return np.zeros(len(drive), dtype=np.bool_) if cleared is None else cleared


def _ramped(share: Array) -> Array:
    """What is left at the end of a rise by one that takes this share (K,T) of the time constants."""
    return np.where(share > 0, -np.expm1(-share) / np.where(share > 0, share, 1.0), 1.0)


@njit(cache=True, nogil=True, inline="always")
def _way(before, now):  # type: ignore[no-untyped-def]
    """Which gain a step has: 1 if the drive leaves for nothing, 2 if it comes from nothing, else 0."""
    before, now = abs(before), abs(now)
    return 1 if now < AIR * before else 2 if before < AIR * now else 0


@njit(cache=True, nogil=True)
def _lag(taken, drive, decay, gains, forget):  # type: ignore[no-untyped-def]
    """All time constants at once, ``decay`` (K,T) and ``gains`` (K,3,T): their memories stay in cache."""
    points, constants = drive.shape[1], len(decay)
    memory, way = np.empty((constants, points)), np.empty(points, dtype=np.int8)
    memory[:] = drive[0]
    taken[:] = 0.0
    for t in range(1, len(drive)):
        if forget[t]:
            memory[:] = drive[t]
            continue
        for n in range(points):
            way[n] = _way(drive[t - 1, n], drive[t, n])
        for k in range(constants):
            left, along, leaving, coming = decay[k, t], gains[k, 0, t], gains[k, 1, t], gains[k, 2, t]
            for n in range(points):
                gain = leaving if way[n] == 1 else coming if way[n] == 2 else along
                memory[k, n] = left * memory[k, n] + gain * (drive[t, n] - drive[t - 1, n])
                taken[t, n] += drive[t, n] - memory[k, n]
        for n in range(points):
            taken[t, n] /= constants


def lagging(
    drive: Array,
    time_s: Array,
    constants_s: Array,
    cleared: NDArray[np.bool_] | None = None,
    *,
    moves_s: float = np.inf,
) -> Array:
    """(T,...) mean over the time constants (K,) of m with m' = (drive - m)/tau, starting at rest.

    That is what has been taken in of the drive (T,...), exactly for any steps of a drive linear between the times
    (T,); where ``cleared`` (T,) nothing has. A drive that leaves for nothing does so within the first ``moves_s`` of a
    step, one that comes from nothing within the last.
    """
    times, constants = (np.asarray(each, dtype=float).tobytes() for each in (time_s, constants_s))
    decay, gains = _decay_and_gains(times, constants, moves_s)
    taken = np.empty(drive.shape)
    flat = np.ascontiguousarray(drive).reshape(len(drive), -1)
    _lag(taken.reshape(len(drive), -1), flat, decay, gains, _forgets(drive, cleared))
    return taken


def relaxing(drive: Array, time_s: Array, constants_s: Array, cleared: NDArray[np.bool_] | None = None) -> Array:
    """(T,...) what of the drive (T,...) has not relaxed yet, mean over Maxwell branches of time constants (K,)."""
    return drive - lagging(drive, time_s, constants_s, cleared)


def moves_within_s(time_s: Array) -> float:
    """How long a press takes to come or go, where frames are at times (T,): no longer than most steps between them.

    A stage leaves when its last scan is over and lands before the next one; what is longer it spends in the air.
    """
    step = np.diff(time_s)
    step = step[step > 0]
    return float(np.quantile(step, 0.25)) if step.size else np.inf
