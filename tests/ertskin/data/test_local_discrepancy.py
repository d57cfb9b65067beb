"""What real presses show beyond the table, carried to the places in between."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from ertskin.data.local_discrepancy import (
    ENOUGH,
    FEWEST,
    LocalDiscrepancy,
    coefficients,
    frame_scatter,
    modes,
    slopes,
)
from ertskin.errors import UserError
from ertskin.models.contacts import ContactsNetwork

sys.path.insert(0, str(Path(__file__).parents[2] / "physics" / "touch"))
from toy_skin import EXTENT_M, FIELDS_M, WIDTH_M, response, toy_table

FORCES = np.array([0.6, 1.2, 2.0, 3.0, 4.0, 5.2])


def real(contact_m: np.ndarray, force_n: np.ndarray) -> np.ndarray:
    """(N,42) of a skin that answers more weakly to strong presses, a millimetre off, from a wider spot."""
    away2 = ((contact_m[:, None] + [1e-3, -5e-4] - FIELDS_M) ** 2).sum(axis=2)
    felt = force_n * (1.0 - 0.02 * force_n + 0.5 * contact_m[:, 0])
    return 300.0 * np.tanh(felt / 6.0)[:, None] * np.exp(-0.5 * away2 / (1.04 * WIDTH_M) ** 2)


def presses(columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    low, high = EXTENT_M
    x, y = np.linspace(low[0] + 0.01, high[0] - 0.01, columns), np.linspace(low[1] + 0.01, high[1] - 0.01, rows)
    place = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return np.repeat(place, len(FORCES), axis=0), np.tile(FORCES, len(place))


def numbered(force: np.ndarray) -> np.ndarray:
    """Which press each frame is of."""
    return np.arange(len(force)) // len(FORCES)


@pytest.fixture(scope="module")
def fitted():
    table, (place, force) = toy_table(), presses(5, 4)
    seen = real(place, force) + np.random.default_rng(0).standard_normal((len(force), 42))
    found, error = LocalDiscrepancy.fit(table, place, force, numbered(force), seen)
    return table, found, error, seen


def along_force(table, place, force, seen):
    """Error of the force that the difference reads as, places known."""
    rows = table.tangents(place, force)
    return np.einsum("nd,nd->n", seen - rows[:, 0], rows[:, 3]) / (rows[:, 3] ** 2).sum(axis=1)


def test_each_number_is_found_across_those_before():
    table, (place, force) = toy_table(), presses(3, 2)
    basis, slope = modes(table, place, force), slopes(table, place, force)
    products = np.einsum("nad,nbd->nab", basis, basis)
    size = np.sqrt(np.diagonal(products, axis1=1, axis2=2))
    assert np.abs(products / size[:, :, None] / size[:, None] - np.eye(6)).max() < 1e-9
    np.testing.assert_array_equal(basis[:, 0], slope[:, 0])
    number = np.einsum("nmd,nd->nm", basis, slope[:, 5]) / size**2
    left = slope[:, 5] - np.einsum("nm,nmd->nd", number, basis)
    assert np.abs(left).max() < 1e-9 * np.abs(slope[:, 5]).max()


def test_where_a_press_was_the_corrected_table_says_what_it_showed(fitted):
    table, found, _, seen = fitted
    corrected = found.correct(table)
    left = seen - corrected.alone(found.contact_m, found.force_n)
    assert np.mean(left**2) < 1.2
    before = along_force(table, found.contact_m, found.force_n, real(found.contact_m, found.force_n))
    after = along_force(corrected, found.contact_m, found.force_n, real(found.contact_m, found.force_n))
    assert np.sqrt(np.mean(after**2)) < 0.1 * np.sqrt(np.mean(before**2))


def test_in_between_it_errs_by_about_as_much_as_it_says(fitted):
    table, found, error, _ = fitted
    rng = np.random.default_rng(1)
    place, force = rng.uniform(EXTENT_M[0] + 0.01, EXTENT_M[1] - 0.01, (200, 2)), rng.uniform(0.7, 5.0, 200)
    corrected = found.correct(table)
    before, after = (along_force(each, place, force, real(place, force)) for each in (table, corrected))
    assert np.sqrt(np.mean(after**2)) < 0.2 * np.sqrt(np.mean(before**2))
    rows = corrected.tangents(place, force)
    stated = error.error[2] * np.linalg.norm(rows[:, 0], axis=1) / np.linalg.norm(rows[:, 3], axis=1)
    assert 0.2 < np.sqrt(np.mean(after**2)) / np.sqrt(np.mean(stated**2)) < 1.5


def test_few_places_tell_no_error():
    table, (place, force) = toy_table(), presses(FEWEST - 1, 1)
    _, error = LocalDiscrepancy.fit(table, place, force, numbered(force), real(place, force))
    assert error.error[2] == pytest.approx(0.1)
    assert error.shape_spread == pytest.approx(np.full(3, 0.1))


def test_what_frames_of_one_press_differ_by_is_known_and_makes_no_process_strong():
    table, (place, force) = toy_table(), presses(3, 2)
    press, rng = numbered(force), np.random.default_rng(3)
    shaken = force * np.exp(rng.normal(0.0, 0.03, len(force)))
    seen = response(place, shaken) + rng.standard_normal((len(force), 42))
    numbers, noise = coefficients(modes(table, place, force), seen - table.alone(place, force))
    assert np.sqrt(frame_scatter(force, press, numbers, noise)[0]) == pytest.approx(0.03, rel=0.4)
    still = response(place, force) + rng.standard_normal((len(force), 42))
    numbers, noise = coefficients(modes(table, place, force), still - table.alone(place, force))
    assert np.sqrt(frame_scatter(force, press, numbers, noise)[0]) < 5e-3
    found, _ = LocalDiscrepancy.fit(table, place, force, press, seen)
    assert np.sqrt(found.variance[0]) < 0.05


def test_few_places_tell_no_scatter():
    table, (place, force) = toy_table(), presses(2, 4)
    press, rng = numbered(force), np.random.default_rng(1)
    strength = np.exp(rng.normal(0.0, 0.3, press.max() + 1))[press]
    seen = response(place, force * strength) + rng.standard_normal((len(force), 42))
    found, _ = LocalDiscrepancy.fit(table, place, force, press, seen)
    assert len(np.unique(place, axis=0)) < ENOUGH
    assert not found.scatter.any()
    assert np.abs(found.correct(table).alone(place, force) - seen).std() < 0.2 * np.abs(seen).std()


def test_what_differs_from_press_to_press_is_carried_nowhere():
    table, (place, force) = toy_table(), presses(5, 4)
    press, rng = numbered(force), np.random.default_rng(1)
    landed = place + rng.normal(0.0, 1e-3, (press.max() + 1, 2))[press]
    strength = np.exp(rng.normal(0.0, 0.1, press.max() + 1))[press]
    seen = response(landed, force * strength) + rng.standard_normal((len(force), 42))
    found, _ = LocalDiscrepancy.fit(table, place, force, press, seen)
    assert np.sqrt(found.scatter[1:3]) == pytest.approx(0.2, rel=0.5)
    one, _ = LocalDiscrepancy.fit(table, place, force, np.zeros_like(press), seen)
    away = np.array([[0.05, 0.03]]), np.array([3.0])
    assert np.abs(found.at(*away)[0, 1:3]).max() < 0.1
    # Frames that are said to be of one press can't scatter: the same readings are then taken for the sheet's own.
    assert np.abs(found.at(place, force)[:, 1:3]).mean() < 0.5 * np.abs(one.at(place, force)[:, 1:3]).mean()


def test_a_network_with_errors_of_another_form_is_refused():
    with pytest.raises(UserError, match="train again"):
        ContactsNetwork(28, [[0.0, 0.0], [0.02, 0.0], [0.0, 0.02], [0.02, 0.02]], shapes={"spread": [4]})
