"""Channels that repeat their last scan reading by reading, which noise never lets a working one do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST = 5
"""Readings a channel must have in two scans on end to be judged."""
BY_CHANCE = 1e-3
"""Channels and frames in a recording that coarse steps alone may make look so."""


def repeating(voltage_v: Array) -> NDArray[np.bool_]:
    """(T,M) where a channel of the readings (T,K,M) in volt gives just what it gave in the frame before.

    NaN says nothing. Readings that never change, of the electrode tied to ground say, don't count unless the whole
    channel never does; nor do frames that most channels repeat: those were written twice or bear no noise.
    """
    there = np.isfinite(voltage_v)
    known = there[1:] & there[:-1]
    same = known & (voltage_v[1:] == voltage_v[:-1])
    fixed = ~(known & ~same).any(axis=0)
    telling = known & (~fixed | fixed.all(axis=0))
    count, alike = telling.sum(axis=1), (same & telling).sum(axis=1)
    chance = float(np.median(alike.sum(axis=0) / np.maximum(count.sum(axis=0), 1)))
    repeats = (count >= FEWEST) & (alike == count) & (chance**count * count.size < BY_CHANCE)
    repeats &= repeats.mean(axis=1, keepdims=True) < 0.5
    return np.vstack([repeats[:1] & repeats.all(axis=0), repeats])
