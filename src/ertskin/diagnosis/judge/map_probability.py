"""How likely a field's map is right: that it follows the true field, where it is determined and over the whole sheet.

A map may be sure in part: presses at 9 of 32 places may show beyond doubt that the fabric isn't even, and how, and say
little of the other 23.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist
from scipy.special import logsumexp

from ertskin.diagnosis.search.smooth_fields import LENGTHS

Array = NDArray[np.float64]

FOLLOWS = 0.8
"""Correlation with the true field from which on a map is right."""
DRAWN = 4000
"""Fields drawn: the probability is known to 0.008."""
SEED = 0
JITTER = 1e-4
"""Part of the variance that a place has for itself: those a finger apart would make the covariance singular."""
SPREADS = np.geomspace(0.3, 6.0, 10)
"""Standard deviations supposed of a field, over that of the values at places."""
LEAST_WEIGHT = 1e-3
"""Weight, over that of the likeliest, from which on a covariance counts."""
FEWEST = 3
"""Points from which on a correlation means something, and places from which on they tell how far a field spreads."""
FEWEST_DETERMINED = 5
"""Points from which on a map is judged where it is determined: of five unrelated values one map in nineteen passes."""


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

    def at(self, number: NDArray[np.bool_]) -> FieldPosterior:
        """The same at some of the points (n,)."""
        return FieldPosterior(self.log_weight, self.mean[number], self.covariance[np.ix_(number, number)])


@dataclass(frozen=True)
class Right:
    """How likely a map is right over the points where it is ``determined``, and over all of them."""

    determined: float | None
    everywhere: float | None


def right_among(found: Array, posteriors: Sequence[FieldPosterior], determined: NDArray[np.bool_]) -> Right:
    """How likely a map (n,) that is ``determined`` (n,) is right where the field is what one of the ``posteriors``
    says, nought where none says anything; None of too few points. Where too few are determined all points count.
    """
    everywhere = _right(found, posteriors)
    if determined.sum() < FEWEST_DETERMINED or determined.all():
        return Right(everywhere, everywhere)
    return Right(_right(found[determined], [one.at(determined) for one in posteriors]), everywhere)


def posteriors_from(places: Places, point_m: Array, side_m: float) -> list[FieldPosterior]:
    """What values at places alone tell of a field at points (n,2); nothing where they are too few, or all the same.

    From them a Gaussian process tells the rest, Matern's of order 3/2 with a mean of its own (universal kriging). Its
    length is one of those that smooth fields have over the sheet's longer ``side_m``, its standard deviation one of
    ``SPREADS``, each as likely as both make the values (restricted likelihood): few places leave the deviation open.
    """
    if not tell(places):
        return []
    kinds = [(length * side_m, spread * float(places.value.std())) for length in LENGTHS for spread in SPREADS]
    likely = np.array([_restricted(places, *kind)[0] for kind in kinds])
    kept = np.flatnonzero(likely > likely.max() + np.log(LEAST_WEIGHT))
    return [kriged(point_m, places, *kinds[k]) for k in kept]


def with_fitted(posteriors: Sequence[FieldPosterior], mean: Array, covariance: Array) -> list[FieldPosterior]:
    """The posteriors of values at places and, as likely as all of them together, what a fit says of the field, ``mean``
    (n,) and ``covariance`` (n,n).

    Alone neither says how often a map is right: of 22 opened recordings (`proof/development.md`) whose fields presses
    alone show eleven maps followed the true one over the whole sheet; by places 3.2 were expected to, by fits 16.6,
    by both 9.9 (squares missed 8.0, 7.0 and 4.8).
    """
    together = float(logsumexp([one.log_weight for one in posteriors]))
    return [*posteriors, FieldPosterior(together, mean, covariance)]


def tell(places: Places) -> bool:
    """Whether places are enough, and differ, to tell how far a field spreads."""
    return len(places.value) >= FEWEST and bool(np.ptp(places.value) > 0.0)


def _right(found: Array, posteriors: Sequence[FieldPosterior]) -> float | None:
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


def kriged(point_m: Array, places: Places, length_m: float, spread: float) -> FieldPosterior:
    """The field at the points (n,2) by its values at places alone, where it is of one length and one standard deviation
    ``spread``."""
    likely, among, one = _restricted(places, length_m, spread)
    value, place_m = places.value, places.point_m
    apart_from = spread**2 * _matern(place_m, point_m, length_m)
    towards = np.linalg.solve(among, apart_from).T
    mean = one @ value / one.sum()
    unsure = 1 - towards.sum(axis=1)
    rest = spread**2 * _matern(point_m, point_m, length_m) - towards @ apart_from
    rest += np.outer(unsure, unsure) / one.sum()
    return FieldPosterior(likely, mean + towards @ (value - mean), rest)


def _restricted(places: Places, length_m: float, spread: float) -> tuple[float, Array, Array]:
    """Logarithm of the values' restricted likelihood, their covariance (K,K), and what that makes of a mean (K,)."""
    count = len(places.value)
    among = spread**2 * (_matern(places.point_m, places.point_m, length_m) + JITTER * np.eye(count))
    among += np.diag(places.error**2)
    one, solved = np.linalg.solve(among, np.stack([np.ones(count), places.value], axis=1)).T
    apart = places.value @ solved - (one @ places.value) ** 2 / one.sum()
    return -0.5 * float(np.linalg.slogdet(among)[1] + np.log(one.sum()) + apart), among, one


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
