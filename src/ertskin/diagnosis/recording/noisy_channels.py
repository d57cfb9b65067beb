"""Channels whose readings scatter more than the others': burst noise, a bad amplifier, a loose wire."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MORE = 1.25
"""Times the scatter of the channel in the middle: of 36 recordings the largest of sound channels has 1.12."""
SURELY = 5.0
"""Standard deviations of chance beyond that."""
FEWEST = 30
"""Readings that a channel must have to be judged."""


def noisy_channels(leftover_v: NDArray[np.floating]) -> dict[int, float]:
    """Channels, and how many times the usual they scatter, by what no network explains of rest frames (R,K,M) in volt;
    nought says nothing.

    From differences of frames on end: what a channel is off by in all of them is another matter.
    """
    if len(leftover_v) < 2:
        return {}
    known = (leftover_v[1:] != 0) & (leftover_v[:-1] != 0)
    change = np.where(known, np.diff(leftover_v.astype(float), axis=0), np.nan)
    count = known.sum(axis=(0, 1))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of channels without readings, which stay NaN
        scatter = np.sqrt(np.nanmean(change**2, axis=(0, 1)))
    ratio = scatter / np.nanmedian(scatter) if np.isfinite(scatter).any() else scatter
    most = MORE + SURELY / np.sqrt(np.maximum(count, 1))
    return {int(k): float(ratio[k]) for k in np.flatnonzero((ratio > most) & (count >= FEWEST))}
