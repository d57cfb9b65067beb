"""How likely a field's map is right: that it follows the true field over the whole sheet, as far as the fit knows it.

A name may be sure where its map is not: presses at 9 of 32 places may show beyond doubt that the fabric isn't even, and
say nothing of the other 23.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FOLLOWS = 0.8
"""Correlation with the true field from which on a map is right."""
DRAWN = 4000
"""Fields drawn: the probability is known to 0.008."""
SEED = 0
FEWEST = 2
"""Places from which on it is told how much they differ."""


def probability(found: Array, expected: Array, covariance: Array) -> float:
    """That a map ``found`` (n,) correlates with the true field by ``FOLLOWS`` or more.

    The true field is normal, with this mean (n,) and covariance (n,n).
    """
    size, vector = np.linalg.eigh(covariance)
    root = vector * np.sqrt(np.maximum(size, 0.0))
    true = expected + np.random.default_rng(SEED).standard_normal((DRAWN, len(root))) @ root.T
    true -= true.mean(axis=1, keepdims=True)
    centred = found - found.mean()
    norm = np.linalg.norm(centred) * np.linalg.norm(true, axis=1)
    # An even map follows nothing.
    return float(np.mean(true @ centred >= FOLLOWS * norm)) if np.ptp(found) > 0 else 0.0


def right_as_fitted(found: Array, covariance: Array) -> float:
    """``probability`` of a map (n,) as a fit has it that leaves the field this covariance (n,n)."""
    return probability(found, found, covariance)


def right_by_places(found: Array, known: NDArray[np.bool_]) -> float:
    """``probability`` of a map (n,) told place by place.

    Where it is ``known`` (n,) it is the true one; elsewhere the field is as places known are from one another, in no
    order.
    """
    if known.sum() < FEWEST:
        return 0.0
    mean, variance = float(found[known].mean()), float(found[known].var(ddof=1))
    return probability(found, np.where(known, found, mean), np.diag(np.where(known, 0.0, variance)))
