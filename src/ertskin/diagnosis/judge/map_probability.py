"""How likely a field's map is right: that it follows the true field over the whole sheet, as far as that is known.

A name may be sure where its map is not: presses at 9 of 32 places may show beyond doubt that the fabric isn't even, and
say little of the other 23.
"""

from __future__ import annotations

from collections.abc import Sequence
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


@dataclass(frozen=True, eq=False)
class FieldPosterior:
    """What is known of a field at n points where it has one covariance beforehand: its ``mean`` (n,) and ``covariance``
    (n,n), and the logarithm of how likely that covariance itself is, up to a constant."""

    log_weight: float
    mean: Array
    covariance: Array


def right_as_fitted(found: Array, covariance: Array) -> float | None:
    """Probability that a map (n,) is right of which the fit leaves this covariance (n,n); None of too few points."""
    return right_among(found, [FieldPosterior(0.0, found, covariance)])


def right_by_places(found: Array, point_m: Array, places: Places, side_m: float) -> float | None:
    """Probability that a map (n,) at points (n,2) is right of which only the values at ``places`` are known; None of
    too few points."""
    return right_among(found, told_by(places, point_m, side_m))


def told_by(places: Places, point_m: Array, side_m: float) -> list[FieldPosterior]:
    """What values at places alone tell of a field at points (n,2); nothing where they are too few, or all the same.

    From them a Gaussian process tells the rest, Matern's of order 3/2 with a mean of its own (universal kriging), its
    variance the likeliest, its length one of those that smooth fields have over the sheet's longer ``side_m``, each as
    likely as it makes the values (restricted likelihood).
    """
    if len(places.value) < FEWEST or np.ptp(places.value) == 0.0:
        return []
    return [kriged(point_m, places, length * side_m) for length in LENGTHS]


def right_among(found: Array, posteriors: Sequence[FieldPosterior]) -> float | None:
    """Probability that a map (n,) is right where the field is what one of the ``posteriors`` says, nought where none
    says anything; None of too few points."""
    if len(found) < FEWEST:
        return None
    if not posteriors:
        return 0.0
    counts = np.rint(DRAWN * _weights(posteriors)).astype(int)
    drawn = [one.mean + _drawn(one.covariance, n) for one, n in zip(posteriors, counts, strict=True) if n]
    return _share_followed(found, np.concatenate(drawn))


def errors_among(found: Array, posteriors: Sequence[FieldPosterior]) -> Array:
    """(n,) standard errors of a map (n,) where the field is what one of the ``posteriors``, one at least, says."""
    square = [np.diag(one.covariance) + (one.mean - found) ** 2 for one in posteriors]
    return np.sqrt(np.maximum(_weights(posteriors) @ np.array(square), 0.0))


def _weights(posteriors: Sequence[FieldPosterior]) -> Array:
    log_weight = np.array([one.log_weight for one in posteriors])
    weight = np.exp(log_weight - log_weight.max())
    return np.asarray(weight / weight.sum())


def kriged(point_m: Array, places: Places, length_m: float) -> FieldPosterior:
    """The field at the points (n,2) by its values at places alone, where it is of one length."""
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
    return FieldPosterior(float(likely), mean + towards @ apart, variance * rest)


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
