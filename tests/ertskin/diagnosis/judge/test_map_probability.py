"""How likely a map is right, against correlations drawn the long way and against what Fisher says of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from ertskin.diagnosis.judge.map_probability import FOLLOWS, probability, right_as_fitted, right_by_places

RNG = np.random.default_rng(3)
FIELD = RNG.standard_normal(40)


def test_it_is_the_share_of_fields_that_the_map_follows() -> None:
    root = 0.4 * RNG.standard_normal((40, 6))
    drawn = FIELD + RNG.standard_normal((20000, 6)) @ root.T
    share = np.mean([np.corrcoef(FIELD, one)[0, 1] >= FOLLOWS for one in drawn])
    assert 0.05 < share < 0.95
    assert right_as_fitted(FIELD, root @ root.T) == pytest.approx(share, abs=0.03)


@pytest.mark.parametrize("error", [0.6, 0.75, 0.9])
def test_of_independent_errors_it_is_as_fisher_says(error: float) -> None:
    # Given the map, the true field is a sample regressed on it: its correlation's arctanh is normal, errors 1/sqrt(n).
    expected = np.std(FIELD) / np.hypot(np.std(FIELD), error)
    chance = norm.cdf((np.arctanh(expected) - np.arctanh(FOLLOWS)) * np.sqrt(len(FIELD) - 3))
    assert right_as_fitted(FIELD, error**2 * np.eye(40)) == pytest.approx(chance, abs=0.12)


def test_an_even_raise_that_nothing_tells_of_does_not_matter() -> None:
    assert right_as_fitted(FIELD, 100 * np.ones((40, 40))) == 1.0


def test_what_is_known_everywhere_is_right_and_an_even_map_never() -> None:
    assert right_as_fitted(FIELD, np.zeros((40, 40))) == 1.0
    assert probability(np.full(40, 0.3), FIELD, np.zeros((40, 40))) == 0.0


def test_of_places_most_must_be_known() -> None:
    known = np.zeros(40, bool)
    chances = []
    for count in (1, 10, 25, 38):
        known[:count] = True
        chances.append(right_by_places(np.where(known, FIELD, 0.0), known))
    assert chances[0] == 0.0
    assert chances[1] < 0.01
    assert 0.1 < chances[2] < 0.9
    assert chances[3] > 0.99


def test_the_same_map_has_the_same_probability() -> None:
    covariance = 0.5 * np.eye(40)
    assert right_as_fitted(FIELD, covariance) == right_as_fitted(FIELD, covariance)
