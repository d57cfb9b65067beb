"""A Newton step within bounds and inequalities against a library's."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from ertskin.diagnosis.fit.bounded_step import Inequalities, Region, bounded_step
from ertskin.diagnosis.fit.quadratic import LocalModel

Array = NDArray[np.float64]


def test_what_leans_on_two_bounds_leaves_the_one_it_gains_by() -> None:
    curvature = 100 * np.array([[1.0, 0.5], [0.5, 1.0]])
    model = LocalModel(np.array([100.0, 500.0]), curvature)
    step = bounded_step(model, np.zeros(2), Region(np.array([0.0, -10.0]), np.array([10.0, 0.0])), damping=0.0)
    assert step == pytest.approx([1.0, 0.0])


def test_numbers_that_are_held_take_the_others_with_them() -> None:
    matrix = np.array([[1.0, 1.0], [0.0, 1.0]])
    model = LocalModel(matrix.T @ np.array([1.0, 0.0]), matrix.T @ matrix)
    held = Region(np.array([-np.inf, 0.5]), np.array([np.inf, 0.5]))
    assert bounded_step(model, np.zeros(2), held, damping=0.0) == pytest.approx([0.5, 0.5])


def test_a_step_goes_along_the_inequalities_that_it_would_break() -> None:
    steps = [_step_within_inequalities(np.random.default_rng(seed)) for seed in range(100)]
    assert all((rows @ step >= least - 1e-9).all() for step, _, rows, least in steps)
    assert any((rows @ step < least + 1e-9).any() for step, _, rows, least in steps)
    assert all(abs(short) < 1e-6 for _, short, _, _ in steps)


def _step_within_inequalities(rng: np.random.Generator) -> tuple[Array, float, Array, Array]:
    """A step, by what part of a library's gain it falls short of that, and the inequalities."""
    matrix, target = rng.normal(size=(12, 5)), 3 * rng.normal(size=12)
    model = LocalModel(matrix.T @ target, matrix.T @ matrix)
    rows, least, low, high = rng.normal(size=(4, 5)), -rng.uniform(0.05, 0.5, 4), np.full(5, -0.4), np.full(5, 0.4)
    step = bounded_step(model, np.zeros(5), Region(low, high, Inequalities(rows, least)), damping=0.0)
    best = minimize(
        lambda x: -model.promised(x),
        np.zeros(5),
        jac=lambda x: model.curvature @ x - model.slope,
        method="SLSQP",
        bounds=list(zip(low, high, strict=True)),
        constraints={"type": "ineq", "fun": lambda x: rows @ x - least, "jac": lambda x: rows},
        options={"ftol": 1e-13, "maxiter": 200},
    )
    return step, 1 + model.promised(step) / best.fun, rows, least


def test_where_no_step_leads_into_the_region_none_is_made() -> None:
    model = LocalModel(np.ones(2), np.eye(2))
    never = Inequalities(np.array([[1.0, 1.0]]), np.array([3.0]))
    step = bounded_step(model, np.zeros(2), Region(-np.ones(2), np.ones(2), never), damping=0.0)
    np.testing.assert_array_equal(step, np.zeros(2))


def test_a_number_that_does_not_show_is_left_where_it_is() -> None:
    model = LocalModel(np.array([2.0, 0.0]), np.diag([1.0, 0.0]))
    region = Region(np.array([-1.0, -1.0]), np.array([1.0, 1.0]))
    np.testing.assert_allclose(bounded_step(model, np.array([0.0, 0.5]), region, damping=1e-6), [1.0, 0.0], atol=1e-9)


def test_a_row_of_numbers_that_are_held_keeps_none_of_the_others() -> None:
    model = LocalModel(np.ones(2), np.eye(2))
    held = Region(np.array([0.7, -1.0]), np.array([0.7, 1.0]), Inequalities(np.array([[3.0, 0.0]]), np.array([2.1])))
    np.testing.assert_allclose(bounded_step(model, np.array([0.7, 0.0]), held, damping=0.0), [0.0, 1.0])


@pytest.mark.parametrize("decades", [0, 3, 6])
def test_scales_and_near_duplicates_do_not_matter(decades: int) -> None:
    """Four hundred rows of a polynomial, as a law's; variables in units that differ by decades."""
    rng = np.random.default_rng(decades)
    design = np.polynomial.chebyshev.chebvander(np.linspace(-1, 1, 400), 9)[:, 1:]
    for _ in range(20):
        unit = 10 ** rng.uniform(-decades, decades, 12)
        matrix, target = rng.normal(size=(30, 12)), 20 * rng.normal(size=30)
        rows = np.hstack([np.zeros((400, 3)), design])
        alike = LocalModel(matrix.T @ target, matrix.T @ matrix)
        bounds = Region(np.full(12, -2.0), np.full(12, 2.0), Inequalities(rows, np.full(400, -0.3)))
        step = bounded_step(alike, np.zeros(12), bounds, damping=1e-9)
        assert (rows @ step).min() == pytest.approx(-0.3, abs=1e-6)
        scaled = LocalModel(alike.slope / unit, alike.curvature / unit[:, None] / unit)
        region = Region(bounds.low * unit, bounds.high * unit, Inequalities(rows / unit, np.full(400, -0.3)))
        np.testing.assert_allclose(bounded_step(scaled, np.zeros(12), region, damping=1e-9) / unit, step, atol=1e-5)
