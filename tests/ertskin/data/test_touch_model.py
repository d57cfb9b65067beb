"""Stated regions are held to the presses that the response was corrected by."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from ertskin.data.touch_model import STATED, ModelError, TouchModel, share_to_hold

sys.path.insert(0, str(Path(__file__).parents[2] / "physics" / "touch"))
from toy_skin import EXTENT_M, response, toy_table


def presses(seed: int, count: int, off_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places said, forces, and readings of presses that land ``off_m`` from where they are said to."""
    rng = np.random.default_rng(seed)
    place, force = rng.uniform(EXTENT_M[0] + 0.01, EXTENT_M[1] - 0.01, (count, 2)), rng.uniform(1.0, 5.0, count)
    landed = place + rng.normal(0.0, off_m, place.shape)
    return place, force, response(landed, force) + rng.standard_normal((count, 42))


def model(seen: np.ndarray) -> TouchModel:
    return TouchModel(toy_table(), np.eye(42), ModelError(np.zeros(3), 0.0, np.array([2e-4, 2e-4, 0.01])), seen)


def held(one: TouchModel, place: np.ndarray, force: np.ndarray, seen: np.ndarray) -> float:
    """Share of the stated regions that hold the press."""
    said = one.posterior(0.1).of(seen, np.column_stack([place, force])[:, None])
    error = np.column_stack([said.contact_m[:, 0], said.force_n[:, 0]]) - np.column_stack([place, force])
    solved = np.linalg.solve(said.covariance[:, 0], error[..., None])[..., 0]
    return float(np.mean((error * solved).sum(axis=1) <= chi2.ppf(STATED, 3)))


def test_regions_grow_until_they_hold_presses_of_the_same_kind() -> None:
    place, force, seen = presses(0, 200, 6e-4)
    narrow = model(seen)
    wide = narrow.widened(place, force, 0.1)
    other = presses(1, 200, 6e-4)
    assert held(narrow, *other) < 0.6
    assert held(wide, *other) == pytest.approx(STATED, abs=0.05)


def test_regions_never_shrink() -> None:
    place, force, seen = presses(0, 100, 0.0)
    assert model(seen).widened(place, force, 0.1).error.widening == 1.0


def test_forces_are_no_surer_than_the_load_cell() -> None:
    """A cell that reads 6 % too much where 5 % are allowed for: its own presses can't tell, other weights do."""
    place, force, seen = presses(2, 200, 0.0)
    by_the_cell = model(seen)
    allowed = by_the_cell.with_force_error(0.05)
    assert held(by_the_cell, place, 1.06 * force, seen) < 0.2
    assert held(allowed, place, 1.06 * force, seen) > 0.5
    starts = np.column_stack([place, force])[:, None]
    before, after = (one.posterior(0.1).of(seen, starts) for one in (by_the_cell, allowed))
    added = after.covariance[:, 0] - before.covariance[:, 0]
    np.testing.assert_allclose(added[:, 2, 2], (0.05 * before.force_n[:, 0]) ** 2, rtol=1e-6)
    added[:, 2, 2] = 0.0
    np.testing.assert_array_equal(added, 0.0)


def test_the_load_cells_error_is_kept_beside_a_widening_and_in_other_directions() -> None:
    place, force, seen = presses(0, 200, 6e-4)
    wide = model(seen).widened(place, force, 0.1)
    allowed = wide.with_force_error(0.05).along(np.eye(42))
    starts = np.column_stack([place, force])[:, None]
    before, after = (one.posterior(0.1).of(seen, starts).covariance[:, 0, 2, 2] for one in (wide, allowed))
    assert wide.error.widening > 1.5
    np.testing.assert_allclose(after - before, (0.05 * force) ** 2, rtol=0.1)


@pytest.mark.parametrize("places", [9, 12, 36])
def test_a_press_more_is_held_as_often_as_stated(places: int) -> None:
    drawn = np.random.default_rng(0).chisquare(3, (20000, places + 1))
    within = drawn[:, -1] <= np.quantile(drawn[:, :-1], share_to_hold(places), axis=1)
    assert STATED - 0.005 <= within.mean() <= STATED + 1.0 / places
    assert share_to_hold(6) == 1.0
