"""Channels whose readings scatter more than the others': burst noise, a bad amplifier, a loose wire."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.recording.evidence import LEAST_FREEDOM, leftover_freedom
from ertskin.physics.protocol import Protocol

MORE = 1.25
"""Times the scatter of the channel in the middle: of 36 recordings the largest of sound channels has 1.12."""
SURELY = 5.0
"""Standard deviations of chance beyond that."""
FEWEST = 30
"""Readings that a channel must have to be judged."""
FEWEST_CHANNELS = 4
"""Channels that must be judged for most of them to say what is usual."""


def noisy_channels(leftover_v: NDArray[np.floating], protocol: Protocol) -> dict[int, float]:
    """Channels, and how many times the usual they scatter, by what no network explains of rest frames (R,K,M) in volt;
    nought says nothing.

    From differences of frames on end: what a channel is always off by is another matter. Readings that a network
    follows closely say nothing, for most of their noise isn't left.
    """
    if len(leftover_v) < 2:
        return {}
    freedom = leftover_freedom(protocol, (leftover_v != 0).mean(axis=0) > 0.5)
    known = (leftover_v[1:] != 0) & (leftover_v[:-1] != 0) & (freedom > LEAST_FREEDOM)
    size = np.sqrt(np.maximum(freedom, LEAST_FREEDOM))
    change = np.where(known, np.diff(leftover_v.astype(float), axis=0) / size, np.nan)
    count = known.sum(axis=(0, 1))
    judged = np.flatnonzero(count >= FEWEST)
    if len(judged) < FEWEST_CHANNELS:
        return {}
    scatter = np.sqrt(np.nanmean(change[..., judged] ** 2, axis=(0, 1)))
    ratio = scatter / np.median(scatter)
    noisy = ratio > MORE + SURELY / np.sqrt(count[judged])
    return {int(k): float(times) for k, times in zip(judged[noisy], ratio[noisy], strict=True)}
