"""How likely a map is right, against fields drawn the long way, Student's distribution and known fields."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.distance import cdist
from scipy.stats import nct

from ertskin.diagnosis.judge.map_probability import (
    FEWEST_DETERMINED,
    FOLLOWS,
    FieldPosterior,
    Places,
    errors_among,
    kriged,
    posteriors_from,
    right_among,
)
from ertskin.diagnosis.judge.undetermined_field import _inflated
from ertskin.diagnosis.search.smooth_fields import LENGTHS

FIELD = np.random.default_rng(3).standard_normal(40)
SIDE_M = 0.12
POINT_M = SIDE_M / 6 * (0.5 + np.stack(np.meshgrid(range(6), range(6)), axis=-1).reshape(-1, 2))


def right_as_fitted(found: NDArray[np.float64], covariance: NDArray[np.float64]) -> float | None:
    """How likely a map is right over all its points, of which a fit leaves this covariance."""
    return right_among(found, [FieldPosterior(0.0, found, covariance)], np.ones(len(found), bool)).everywhere


def test_it_is_the_share_of_fields_that_the_map_follows() -> None:
    rng = np.random.default_rng(4)
    root = 0.4 * rng.standard_normal((40, 6))
    fields = FIELD + rng.standard_normal((20000, 6)) @ root.T
    share = np.mean([np.corrcoef(FIELD, one)[0, 1] >= FOLLOWS for one in fields])
    assert 0.05 < share < 0.95
    assert right_as_fitted(FIELD, root @ root.T) == pytest.approx(share, abs=0.03)


@pytest.mark.parametrize("error", [0.6, 0.75, 0.9])
def test_of_independent_errors_it_is_as_student_says(error: float) -> None:
    # What is drawn is regressed on a given map: its correlation r has r sqrt((n - 2) / (1 - r^2)) not central t.
    count = len(FIELD)
    least = FOLLOWS * np.sqrt((count - 2) / (1 - FOLLOWS**2))
    chance = nct.sf(least, count - 2, np.sqrt(count) * FIELD.std() / error)
    assert right_as_fitted(FIELD, error**2 * np.eye(count)) == pytest.approx(chance, abs=0.02)


def test_an_even_raise_that_nothing_tells_of_does_not_matter() -> None:
    assert right_as_fitted(FIELD, 100 * np.ones((40, 40))) == 1.0


def test_a_map_known_everywhere_is_right_and_an_even_one_never() -> None:
    assert right_as_fitted(FIELD, np.zeros((40, 40))) == 1.0
    assert right_as_fitted(np.full(40, 0.3), np.eye(40)) == 0.0


def drawn(length_m: float, count: int, seed: int = 0) -> NDArray[np.float64]:
    """(count,36) fields that spread so far."""
    apart = np.sqrt(3) * cdist(POINT_M, POINT_M) / length_m
    covariance = (1 + apart) * np.exp(-apart)
    return np.random.default_rng(seed).multivariate_normal(np.zeros(36), covariance, count, method="eigh")


def told(found: NDArray[np.float64], field: NDArray[np.float64], known: NDArray[np.bool_], error: float = 0.0) -> float:
    """The probability of a map where a field is known at some of the points."""
    places = Places(POINT_M[known], field[known], np.full(known.sum(), error))
    right = right_among(found, posteriors_from(places, POINT_M, SIDE_M), known).everywhere
    assert right is not None
    return right


def test_what_has_no_order_is_known_where_most_places_are() -> None:
    lots = drawn(1e-3, 1)[0]
    chances = []
    for count in (2, 9, 24, 35):
        known = np.arange(36) < count
        chances.append(told(np.where(known, lots, lots[known].mean()), lots, known))
    assert chances[0] == 0.0
    assert chances[1] < 0.1
    assert chances[1] < chances[2] < chances[3]
    assert chances[3] > 0.98


def test_of_broad_hills_fewer_places_are_enough() -> None:
    known, rng = np.arange(36) % 2 == 0, np.random.default_rng(1)
    hills = drawn(0.5 * SIDE_M, 20)
    ordered = np.mean([told(one, one, known) for one in hills])
    unordered = np.mean([told(one, one, known) for one in map(rng.permutation, hills)])
    assert ordered > unordered + 0.4


def test_values_that_err_make_no_sure_map() -> None:
    field, known = drawn(0.25 * SIDE_M, 1)[0], np.ones(36, bool)
    assert told(field, field, known) > 0.99
    assert told(field, field, known, error=float(field.std())) < 0.5


def test_probabilities_are_as_often_right_as_they_say() -> None:
    right, stated, rng = [], [], np.random.default_rng(2)
    for length_m in SIDE_M * np.array([0.1, 0.25, 0.5]):
        for field in drawn(length_m, 60, seed=3):
            known = np.isin(np.arange(36), rng.permutation(36)[:20])
            found = field[known][cdist(POINT_M, POINT_M[known]).argmin(axis=1)]
            stated.append(told(found, field, known))
            right.append(np.corrcoef(found, field)[0, 1] >= FOLLOWS)
    assert np.mean(stated) == pytest.approx(np.mean(right), abs=0.08)
    assert np.mean(np.array(right)[np.array(stated) > 0.7]) > 0.7


@pytest.mark.parametrize("count", [4, 9, 18])
def test_few_places_say_how_much_they_leave_open(count: int) -> None:
    off, stated, right, rng = [], [], [], np.random.default_rng(5)
    for length_m in SIDE_M * np.array(LENGTHS):
        for field in drawn(length_m, 12, seed=6):
            known = np.isin(np.arange(36), rng.permutation(36)[:count])
            posteriors = posteriors_from(Places(POINT_M[known], field[known], np.zeros(count)), POINT_M, SIDE_M)
            weight = np.exp([one.log_weight for one in posteriors])
            found = np.tensordot(weight / weight.sum(), [one.mean for one in posteriors], 1)
            off.append(np.abs((found - field) / errors_among(found, posteriors))[~known])
            stated.append(right_among(found, posteriors, known).everywhere)
            right.append(np.corrcoef(found, field)[0, 1] >= FOLLOWS)
    assert float(np.mean(np.concatenate(off) < 1.645)) == pytest.approx(0.9, abs=0.04)
    assert np.mean(np.array(stated, dtype=float)) == pytest.approx(np.mean(right), abs=0.1)


def test_places_that_err_tell_no_more_than_they_know() -> None:
    field, known = drawn(0.1 * SIDE_M, 1)[0], np.arange(36) % 3 == 0
    # What was read by chance says how far the field spreads: less and less, the more it errs by.
    posteriors = posteriors_from(Places(POINT_M[known], field[known], np.full(12, 10 * field.std())), POINT_M, SIDE_M)
    assert errors_among(field, posteriors)[known].min() > 1.5 * field.std()


def test_of_too_few_points_nothing_is_said() -> None:
    assert right_as_fitted(FIELD[:2], np.eye(2)) is None
    posteriors = posteriors_from(Places(POINT_M, FIELD[:36], np.zeros(36)), POINT_M[:2], SIDE_M)
    assert right_among(FIELD[:2], posteriors, np.ones(2, bool)).determined is None


@pytest.mark.parametrize("error", [0.6, 0.9])
def test_where_it_is_determined_it_is_as_sure_as_a_map_of_those_points(error: float) -> None:
    determined = np.arange(len(FIELD)) % 2 == 0
    covariance = np.diag(np.where(determined, error, 3.0) ** 2)
    found = right_among(FIELD, [FieldPosterior(0.0, FIELD, covariance)], determined)
    assert found.everywhere == right_as_fitted(FIELD, covariance)
    assert found.everywhere is not None
    assert found.everywhere < 0.05
    assert found.determined == pytest.approx(
        right_as_fitted(FIELD[determined], covariance[np.ix_(determined, determined)]), abs=0.02
    )


def test_too_few_points_are_no_map_of_their_own() -> None:
    covariance = np.diag(np.where(np.arange(40) < FEWEST_DETERMINED, 1e-3, 1.0) ** 2)
    posteriors = [FieldPosterior(0.0, FIELD, covariance)]
    few, enough = (
        right_among(FIELD, posteriors, np.arange(40) < count) for count in (FEWEST_DETERMINED - 1, FEWEST_DETERMINED)
    )
    assert few.determined == few.everywhere == enough.everywhere
    assert enough.determined == 1.0


def test_places_that_err_say_no_more_often_than_they_should_that_a_map_is_right_there() -> None:
    right, stated, as_it_is, rng = [], [], [], np.random.default_rng(7)
    for share in (0.4, 0.6, 0.8):
        for field in drawn(0.1 * SIDE_M, 60, seed=8):
            known, error = np.isin(np.arange(36), rng.permutation(36)[:12]), share * float(field.std())
            places = Places(
                POINT_M[known], field[known] + error * rng.standard_normal(known.sum()), np.full(known.sum(), error)
            )
            found = places.value[cdist(POINT_M, places.point_m).argmin(axis=1)]
            stated.append(right_among(found, posteriors_from(places, POINT_M, SIDE_M), known).determined)
            true_kind = kriged(POINT_M, places, 0.1 * SIDE_M, 1.0)
            as_it_is.append(right_among(found, [true_kind], known).determined)
            right.append(np.corrcoef(found[known], field[known])[0, 1] >= FOLLOWS)
    sure, follows = np.array(stated, dtype=float), np.array(right)
    assert 0.3 < follows.mean() < 0.8
    assert np.mean(np.array(as_it_is, dtype=float)) == pytest.approx(follows.mean(), abs=0.06)
    # Where its length and its deviation are asked of twelve values that err, it is somewhat too careful.
    assert follows.mean() - 0.15 < sure.mean() < follows.mean() + 0.03
    assert follows[sure > 0.8].mean() > 0.8


def test_the_same_map_has_the_same_probability() -> None:
    assert right_as_fitted(FIELD, 0.5 * np.eye(40)) == right_as_fitted(FIELD, 0.5 * np.eye(40))


def test_more_noise_leaves_what_nothing_tells_as_it_was() -> None:
    # Two modes: of one readings tell much, of the other nothing.
    whole = _inflated(np.diag([0.1, 1.0]), 4.0)
    assert np.diag(whole) == pytest.approx([1 / (9 / 4 + 1), 1.0])
    assert _inflated(np.diag([0.1, 1.0]), 1.0) == pytest.approx(np.diag([0.1, 1.0]))
