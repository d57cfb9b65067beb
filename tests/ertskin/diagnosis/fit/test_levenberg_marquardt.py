"""The descent against a library's, where what is left of the residuals is large and where bounds are in the way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares, lsq_linear

from ertskin.diagnosis.fit import levenberg_marquardt
from ertskin.diagnosis.fit.bounded_step import Inequalities, Region
from ertskin.diagnosis.fit.levenberg_marquardt import Fit, descend
from ertskin.diagnosis.fit.quadratic import Quadratic

Array = NDArray[np.float64]
WIDE = np.full(2, 1e3)
EVERYWHERE = Region(-WIDE, WIDE)


def descended(
    residual: Callable[[Array], Array],
    slope: Callable[[Array], Array],
    begin: Array,
    region: Region = EVERYWHERE,
    **settings: object,
) -> tuple[Fit, int]:
    """The fit, and how often it was linearised."""
    asked = []

    def linearise(x: Array) -> Quadratic:
        asked.append(x)
        wrong, columns = -residual(x), slope(x)
        return Quadratic(np.array([0.5 * wrong @ wrong]), (columns.T @ wrong)[None], (columns.T @ columns)[None])

    nothing = np.zeros(len(begin))
    fit = descend(
        linearise,
        lambda x: 0.5 * float((residual(x) ** 2).sum()),
        begin,
        region,
        nothing,
        nothing,
        steps=200,
        tolerance=1e-10,
        **settings,  # type: ignore[arg-type]
    )
    return fit, len(asked)


def brown_dennis(x: Array) -> Array:
    """The problem of Brown and Dennis, with half of its numbers: residuals of some hundreds are left."""
    t = np.arange(1, 21) / 5
    return np.asarray((x[0] + t * x[1] - np.exp(t)) ** 2 / 10 + t)


def brown_dennis_slope(x: Array) -> Array:
    t = np.arange(1, 21) / 5
    inner = (x[0] + t * x[1] - np.exp(t)) / 5
    return np.stack([inner, t * inner], axis=1)


def test_where_large_residuals_stay_secants_come_down_in_half_the_steps() -> None:
    begin = np.array([25.0, 5.0])
    expected = least_squares(brown_dennis, begin, brown_dennis_slope, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    with_secants, few = descended(brown_dennis, brown_dennis_slope, begin)
    without, many = descended(brown_dennis, brown_dennis_slope, begin, secants=False)
    for fit in (with_secants, without):
        assert float(fit.quadratic.cost[0]) == pytest.approx(expected.cost, rel=1e-6)
    assert with_secants.value == pytest.approx(expected.x, rel=1e-3)
    assert few <= 0.5 * many


def test_where_none_are_left_secants_do_no_harm() -> None:
    """Rosenbrock's valley."""

    def residual(x: Array) -> Array:
        return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])

    def slope(x: Array) -> Array:
        return np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])

    counts = []
    for secants in (True, False):
        fit, count = descended(residual, slope, np.array([-1.2, 1.0]), secants=secants)
        assert fit.value == pytest.approx([1.0, 1.0], rel=1e-4)
        counts.append(count)
    assert counts[0] <= 1.5 * counts[1]


@pytest.mark.parametrize("at_bound", [False, True], ids=["inside", "on a bound"])
def test_a_descent_within_bounds_ends_where_a_library_s_does(at_bound: bool) -> None:
    assert all(_ends_at_the_minimum(np.random.default_rng(seed), at_bound) for seed in range(200))


def _ends_at_the_minimum(rng: np.random.Generator, at_bound: bool) -> bool:
    """Of a linear problem of six variables that go together."""
    matrix, target = rng.normal(size=(12, 6)) + 2 * rng.normal(size=(12, 1)), 5 * rng.normal(size=12)
    low, high = -rng.uniform(0.1, 2.0, 6), rng.uniform(0.1, 2.0, 6)
    expected = lsq_linear(matrix, target, (low, high), tol=1e-12).cost
    begin = np.where(rng.random(6) < 0.5, low, high) if at_bound else np.zeros(6)
    fit, _ = descended(lambda x: matrix @ x - target, lambda x: matrix, begin, Region(low, high))
    return bool(fit.quadratic.cost[0] <= expected + 1e-3 * max(1.0, expected))


def test_a_descent_goes_along_a_wall_behind_which_there_is_nothing() -> None:
    jacobian = np.array([[10.0, 10.0], [1.0, -1.0]])

    def wrong(x: Array) -> Array:
        return jacobian @ x - np.array([10.0, -8.0]) if x[0] > 0.1 else np.full(2, np.inf)

    wall = Inequalities(np.array([[1.0, 0.0]]), np.array([0.2]))
    along, _ = descended(wrong, lambda x: jacobian, np.array([2.0, 3.0]), Region(-WIDE, WIDE, wall))
    assert along.value == pytest.approx([0.2, 176.4 / 202])
    before, _ = descended(wrong, lambda x: jacobian, np.array([2.0, 3.0]))
    assert before.quadratic.cost[0] > 1.05 * along.quadratic.cost[0]


def test_a_second_order_part_is_made_positive_where_a_variable_hardly_shows() -> None:
    part = np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 0.2], [0.0, 0.2, 1.0]])
    for shows in (1.0, 1e-16, 1e-300, 0.0):
        curvature = np.array([[1.0, 0.3, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, shows]])
        found = levenberg_marquardt._positive(curvature, part)
        np.testing.assert_allclose(found, curvature + part, rtol=1e-9, atol=1e-12)
    found = levenberg_marquardt._positive(np.diag([1.0, 1.0]), np.diag([-3.0, 0.5]))
    assert np.linalg.eigvalsh(found).min() > 0
    assert found[1, 1] == pytest.approx(1.5)


def test_earlier_secants_are_kept_where_a_step_says_nothing_of_them() -> None:
    curvature, part = np.diag([1.0, 2.0]), np.diag([0.5, 0.7])
    step = np.array([0.0, 1.0])
    updated = levenberg_marquardt._updated(part, curvature, step, (curvature + part) @ step)
    np.testing.assert_allclose(updated, part)
    steeper = levenberg_marquardt._updated(part, curvature, step, np.array([0.0, 4.0]))
    np.testing.assert_allclose(steeper @ step, [0.0, 2.0])
    assert steeper[0, 0] == pytest.approx(0.5)
    np.testing.assert_array_equal(levenberg_marquardt._updated(part, curvature, step, -step), part)


def test_a_descent_may_begin_outside_of_its_inequalities() -> None:
    matrix = np.array([[1.0, 0.5, 0.2], [0.3, 1.0, 0.1], [0.1, 0.2, 1.0]])
    target, low = np.array([-50.0, 0.0, 0.0]), Inequalities(np.array([[1.0, 0.0, 0.0]]), np.array([0.1]))
    begin = np.linalg.solve(matrix, target) + np.array([0.0, 3.0, 0.0])
    wide = np.full(3, 1e3)
    fit, _ = descended(lambda x: matrix @ x - target, lambda x: matrix, begin, Region(-wide, wide, low))
    assert fit.quadratic.cost[0] == pytest.approx(0.0, abs=1e-9)


def test_a_hopeless_descent_is_given_up_once_begun() -> None:
    begin, few = np.array([25.0, 5.0]), levenberg_marquardt.BEGUN + 1
    whole, often = descended(brown_dennis, brown_dennis_slope, begin)
    assert often > few
    for hopeless, asked in ((0.5 * whole.quadratic.cost[0], few), (1e9, often)):
        _, counted = descended(brown_dennis, brown_dennis_slope, begin, hopeless=hopeless)
        assert counted == asked
