"""The nearest point that fulfils inequalities, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.physics.least_distance import nearest_point


def test_the_nearest_point_of_a_half_space_and_of_a_corner() -> None:
    point, normal = np.array([3.0, -1.0]), np.array([[3.0, 4.0]])
    np.testing.assert_allclose(nearest_point(point, normal, np.array([15.0])), point + 10 / 25 * normal[0])
    np.testing.assert_allclose(nearest_point(point, -np.eye(2), np.array([-1.0, 2.0])), [1.0, -2.0])


def test_a_point_that_fulfils_them_stays() -> None:
    np.testing.assert_allclose(nearest_point(np.array([3.0]), np.array([[1.0]]), np.array([2.0])), [3.0])


@pytest.mark.parametrize("least", [1.0, 1e-6, 1e6])
def test_where_none_does_there_is_none(least: float) -> None:
    rows = np.array([[1.0], [-1.0]])
    assert nearest_point(np.zeros(1), rows, np.array([least, least])) is None
