"""How likely a field's map is right: that it follows the true field over the whole sheet, as far as that is known.

A name may be sure where its map is not: presses at 9 of 32 places may show beyond doubt that the fabric isn't even, and
say little of the other 23.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from ertskin.diagnosis.search.smooth_fields import LENGTHS

Array = NDArray[np.float64]

FOLLOWS = 0.8
"""Correlation with the true field from which on a map is right."""
DRAWN = 4000
"""Fields drawn: the probability is known to 0.008."""
SEED = 0
JITTER = 1e-4
"""Part of the variance that a place has for itself: those a finger apart would make the covariance singular."""
FEWEST = 3
"""Points from which on a correlation means something, and places from which on they tell how far a field spreads."""


@dataclass(frozen=True, eq=False)
class Places:
    """Where something has pressed, ``point_m`` (K,2), the field's ``value`` (K,) there and its standard ``error``
    (K,)."""

    point_m: Array
    value: Array
    error: Array


def right_as_fitted(found: Array, covariance: Array) -> float | None:
    """Probability that a map (n,) is right of which the fit leaves this covariance (n,n); None of too few points."""
    if len(found) < FEWEST:
        return None
    return _share_followed(found, found + _drawn(covariance, DRAWN))


def right_by_places(found: Array, point_m: Array, places: Places, side_m: float) -> float | None:
    """Probability that a map (n,) at points (n,2) is right of which only the values at ``places`` are known; None of
    too few points.

    From them a Gaussian process tells the rest, Matern's of order 3/2 with a mean of its own (universal kriging), its
    variance the likeliest, its length one of those that smooth fields have over the sheet's longer ``side_m``, each as
    likely as it makes the values (restricted likelihood).
    """
    if len(found) < FEWEST:
        return None
    if len(places.value) < FEWEST or np.ptp(places.value) == 0.0:
        return 0.0
    told = [kriged(point_m, places, length * side_m) for length in LENGTHS]
    weight = np.exp([likely - max(one[0] for one in told) for likely, _, _ in told])
    counts = np.rint(DRAWN * weight / weight.sum()).astype(int)
    fields = [mean + _drawn(rest, count) for (_, mean, rest), count in zip(told, counts, strict=True)]
    return _share_followed(found, np.concatenate(fields))


def kriged(point_m: Array, places: Places, length_m: float) -> tuple[float, Array, Array]:
    """Log likelihood of the values of one length, and mean (n,) and covariance (n,n) of the field at the points."""
    value, place_m = places.value, places.point_m
    among = _matern(place_m, place_m, length_m) + np.diag(JITTER + (places.error / value.std()) ** 2)
    towards = np.linalg.solve(among, _matern(place_m, point_m, length_m)).T
    one = np.linalg.solve(among, np.ones(len(value)))
    mean = one @ value / one.sum()
    apart = value - mean
    variance = apart @ np.linalg.solve(among, apart) / (len(value) - 1)
    unsure = 1 - towards.sum(axis=1)
    rest = _matern(point_m, point_m, length_m) - towards @ _matern(place_m, point_m, length_m)
    rest += np.outer(unsure, unsure) / one.sum()
    likely = -0.5 * ((len(value) - 1) * np.log(variance) + np.linalg.slogdet(among)[1] + np.log(one.sum()))
    return float(likely), mean + towards @ apart, variance * rest


def _matern(one_m: Array, other_m: Array, length_m: float) -> Array:
    apart = np.sqrt(3.0) * cdist(one_m, other_m) / length_m
    return np.asarray((1 + apart) * np.exp(-apart))


def _drawn(covariance: Array, count: int) -> Array:
    """(count,n) normal deviations of this covariance (n,n)."""
    size, vector = np.linalg.eigh(covariance)
    root = vector * np.sqrt(np.maximum(size, 0.0))
    return np.asarray(np.random.default_rng(SEED).standard_normal((count, len(root))) @ root.T)


def _share_followed(found: Array, fields: Array) -> float:
    """Of fields (S,n), the part that a map (n,) correlates with by ``FOLLOWS`` or more; an even one follows none."""
    if np.ptp(found) == 0.0:
        return 0.0
    centred, true = found - found.mean(), fields - fields.mean(axis=1, keepdims=True)
    norm = np.linalg.norm(centred) * np.linalg.norm(true, axis=1)
    return float(np.mean((norm > 0) & (true @ centred >= FOLLOWS * norm)))
