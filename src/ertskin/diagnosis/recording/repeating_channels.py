"""Channels that repeat their last scan reading by reading, which noise never lets a working one do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.criteria import Criteria

Array = NDArray[np.float64]

FEWEST = 5
"""Readings a channel must have in two scans on end to be judged."""


def repeating(voltage_v: Array, criteria: Criteria) -> NDArray[np.bool_]:
    """(T,M) where a channel of the readings (T,K,M) in volt gives just what it gave last.

    NaN says nothing. Readings that never change don't count unless the whole channel never does; nor do frames that
    most channels repeat: those were written twice or bear no noise.
    """
    last = _last_known(voltage_v)
    known = np.isfinite(voltage_v[1:]) & np.isfinite(last[:-1])
    same = known & (voltage_v[1:] == last[:-1])
    fixed = ~(known & ~same).any(axis=0)
    dead = fixed.all(axis=0)
    dead &= dead.mean() <= 0.5
    telling = known & (~fixed | dead)
    count, alike = telling.sum(axis=1), (same & telling).sum(axis=1)
    repeats = (count >= FEWEST) & (alike == count) & (_by_chance(alike, count, dead) < criteria.chance)
    repeats &= dead | ((repeats & ~dead).mean(axis=1, keepdims=True) <= 0.5)
    never = dead & repeats.any(axis=0)
    return np.vstack([never, repeats | never])


def _last_known(voltage_v: Array) -> Array:
    """(T,K,M) the last reading there was up to each frame, NaN before the first."""
    frame = np.arange(len(voltage_v))[:, None, None]
    latest = np.maximum.accumulate(np.where(np.isfinite(voltage_v), frame, 0), axis=0)
    return np.take_along_axis(voltage_v, latest, axis=0)


def _by_chance(alike: NDArray[np.intp], count: NDArray[np.intp], dead: NDArray[np.bool_]) -> Array:
    """(T-1,M) in how many frames and channels all ``count`` readings would be alike if single ones are so by chance.

    As often as in the channel in the middle: over the recording or, but for ``dead`` ones, in the frame if that is
    more, for frames in which nothing moves are more alike. Or as in the channel itself where it doesn't repeat whole.
    """
    if not count.size:
        return np.zeros(count.shape)
    overall = float(np.median(alike.sum(axis=0) / np.maximum(count.sum(axis=0), 1)))
    in_frame = np.median(alike / np.maximum(count, 1), axis=1, keepdims=True)
    apart = alike < count
    own = (alike * apart).sum(axis=0) / np.maximum((count * apart).sum(axis=0), 1)
    return np.asarray(np.maximum(np.where(dead, overall, np.maximum(overall, in_frame)), own) ** count * count.size)
