"""How likely a map is right, against fields drawn the long way, Fisher's transform and known fields."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.distance import cdist
from scipy.stats import norm

from ertskin.diagnosis.judge.map_probability import FOLLOWS, right_as_fitted, right_by_places

RNG = np.random.default_rng(3)
FIELD = RNG.standard_normal(40)
SIDE_M = 0.12
POINT_M = SIDE_M / 6 * (0.5 + np.stack(np.meshgrid(range(6), range(6)), axis=-1).reshape(-1, 2))


def test_it_is_the_share_of_fields_that_the_map_follows() -> None:
    root = 0.4 * RNG.standard_normal((40, 6))
    drawn = FIELD + RNG.standard_normal((20000, 6)) @ root.T
    share = np.mean([np.corrcoef(FIELD, one)[0, 1] >= FOLLOWS for one in drawn])
    assert 0.05 < share < 0.95
    assert right_as_fitted(FIELD, root @ root.T) == pytest.approx(share, abs=0.03)


@pytest.mark.parametrize("error", [0.6, 0.75, 0.9])
def test_of_independent_errors_it_is_as_fisher_says(error: float) -> None:
    expected = np.std(FIELD) / np.hypot(np.std(FIELD), error)
    chance = norm.cdf((np.arctanh(expected) - np.arctanh(FOLLOWS)) * np.sqrt(len(FIELD) - 3))
    # The map is given, only the true field is drawn: not quite Fisher's case.
    assert right_as_fitted(FIELD, error**2 * np.eye(40)) == pytest.approx(chance, abs=0.12)


def test_an_even_raise_that_nothing_tells_of_does_not_matter() -> None:
    assert right_as_fitted(FIELD, 100 * np.ones((40, 40))) == 1.0


def test_a_map_known_everywhere_is_right_and_an_even_one_never() -> None:
    assert right_as_fitted(FIELD, np.zeros((40, 40))) == 1.0
    assert right_as_fitted(np.full(40, 0.3), np.eye(40)) == 0.0


def drawn(length_m: float, count: int) -> NDArray[np.float64]:
    """(count,36) fields that spread so far."""
    apart = np.sqrt(3) * cdist(POINT_M, POINT_M) / length_m
    return RNG.multivariate_normal(np.zeros(36), (1 + apart) * np.exp(-apart), count, method="eigh")


def test_what_has_no_order_is_known_where_most_places_are() -> None:
    lots = drawn(1e-3, 1)[0]
    chances = []
    for count in (2, 9, 24, 35):
        known = np.arange(36) < count
        found = np.where(known, lots, lots[known].mean())
        chances.append(right_by_places(found, POINT_M, lots[known], POINT_M[known], SIDE_M))
    assert chances[0] == 0.0
    assert chances[1] < 0.1
    assert chances[2] == pytest.approx(0.5, abs=0.45)
    assert chances[3] > 0.98


def test_of_broad_hills_fewer_places_are_enough() -> None:
    hills, known = drawn(0.5 * SIDE_M, 1)[0], np.arange(36) % 2 == 0
    mixed = RNG.permutation(hills)
    told, unordered = (right_by_places(one, POINT_M, one[known], POINT_M[known], SIDE_M) for one in (hills, mixed))
    assert told > 0.5
    assert unordered < 0.2


def test_probabilities_are_as_often_right_as_they_say() -> None:
    right, stated = [], []
    for length_m in SIDE_M * np.array([0.1, 0.25, 0.5]):
        for field in drawn(length_m, 60):
            known = RNG.permutation(36) < 20
            near = cdist(POINT_M, POINT_M[known]).argmin(axis=1)
            found = field[known][near]
            stated.append(right_by_places(found, POINT_M, field[known], POINT_M[known], SIDE_M))
            right.append(np.corrcoef(found, field)[0, 1] >= FOLLOWS)
    assert np.mean(stated) == pytest.approx(np.mean(right), abs=0.08)
    assert np.mean(np.array(right)[np.array(stated) > 0.7]) > 0.7


def test_the_same_map_has_the_same_probability() -> None:
    assert right_as_fitted(FIELD, 0.5 * np.eye(40)) == right_as_fitted(FIELD, 0.5 * np.eye(40))
