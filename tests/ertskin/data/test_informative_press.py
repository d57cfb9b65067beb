"""What is still unknown of a skin after some presses, and the press that tells most."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from ertskin.data.informative_press import Accuracy, PressDesign, _Response, judged, likely, most_telling
from ertskin.data.local_discrepancy import EXPECTED, Process, evidences, modes, slopes

sys.path.insert(0, str(Path(__file__).parents[2] / "physics" / "touch"))
from toy_skin import EXTENT_M, response, toy_table

FORCES = np.array([1.0, 3.0, 5.0])
PLACES = np.stack(np.meshgrid(np.linspace(0.01, 0.07, 4), np.linspace(0.01, 0.05, 3)), axis=-1).reshape(-1, 2)
WANTED = Accuracy(0.1, 5e-4)


def pressed(places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Places, forces, numbers and readings of presses on a skin that answers 8 % more on its right side."""
    place, force = np.repeat(places, len(FORCES), axis=0), np.tile(FORCES, len(places))
    noise = np.random.default_rng(0).standard_normal((len(force), 42))
    press = np.repeat(np.arange(len(places)), len(FORCES))
    return place, force, press, response(place, force * (1.0 + place[:, 0])) + noise


@pytest.fixture(scope="module")
def design() -> PressDesign:
    return PressDesign(toy_table(), *pressed(PLACES[[0, 4]]), largest_n=5.0)


def test_what_a_press_more_is_expected_to_gain_is_what_it_gains_once_made(design: PressDesign) -> None:
    predicted = design.accuracies(PLACES[[7]], FORCES)[0]
    made = PressDesign(design.table, *pressed(PLACES[[0, 4, 7]]), largest_n=5.0)
    made.processes = design.processes
    assert made.accuracy().force_n == pytest.approx(predicted.force_n, rel=1e-6)
    assert made.accuracy().location_m == pytest.approx(predicted.location_m, rel=1e-6)
    assert predicted.cost(WANTED) < design.accuracy().cost(WANTED)


def test_the_next_press_is_away_from_those_before(design: PressDesign) -> None:
    best, then = most_telling(design, PLACES, FORCES, WANTED)
    assert np.linalg.norm(PLACES[best] - PLACES[[0, 4]], axis=1).min() > 0.03
    assert then.cost(WANTED) == min(each.cost(WANTED) for each in design.accuracies(PLACES, FORCES))
    again = design.accuracies(PLACES[[0]], FORCES)[0]
    assert design.accuracy().force_n - again.force_n < 0.2 * (design.accuracy().force_n - then.force_n)


def test_errors_are_those_of_a_linear_fit_with_unknown_shapes() -> None:
    table, rng = toy_table(), np.random.default_rng(1)
    place, force = np.array([[0.033, 0.027]]), np.array([3.0])
    basis, deviation = modes(table, place, force), np.array([0.02, 0.01, 0.03, 0.1, 0.2, 0.15])
    log_force, place_m2 = _Response.of(table, place, force).errors(deviation[None] ** 2)
    # The same by drawing skins: the reading holds the numbers, the fit knows their spread and nothing else.
    slope, shape = slopes(table, place, force)[0, :3].T, basis[0, 3:].T
    covariance = np.eye(42) + shape @ np.diag(deviation[3:] ** 2) @ shape.T
    fit = np.linalg.solve(slope.T @ np.linalg.solve(covariance, slope), slope.T @ np.linalg.inv(covariance))
    numbers = rng.standard_normal((20_000, 6)) * deviation
    error = (numbers @ basis[0] + rng.standard_normal((20_000, 42))) @ fit.T
    assert log_force[0] == pytest.approx(error[:, 0].var(), rel=0.05)
    assert place_m2[0] == pytest.approx(25e-6 * (error[:, 1].var() + error[:, 2].var()), rel=0.05)


def test_the_whole_sheet_is_judged_up_to_the_largest_force() -> None:
    place, force = judged(toy_table(), 5.0)
    assert force.max() == 5.0
    assert np.allclose(place.mean(axis=0), EXTENT_M.mean(axis=0))
    assert (place.min(axis=0) < EXTENT_M[0] + 8e-3).all()


def test_one_place_leaves_every_length_possible_and_many_tell_it() -> None:
    rng = np.random.default_rng(2)

    def processes(place: np.ndarray) -> list[tuple[float, Process]]:
        number = 0.1 * np.sin(place[:, 0] / 0.016) + 1e-3 * rng.standard_normal(len(place))
        press, force = np.arange(len(place)), np.full(len(place), 2.0)
        return likely(evidences(place, force, press, number, np.full(len(place), 1e-6)))

    one, many = processes(np.array([[0.04, 0.03]])), processes(rng.uniform(EXTENT_M[0], EXTENT_M[1], (60, 2)))
    assert len({process.length_m for _, process in one}) == 5
    assert sum(share for share, _ in one) == pytest.approx(1.0)
    share, process = max(many)
    assert process.length_m in (0.016, 0.032)
    assert process.variance == pytest.approx(EXPECTED**2, rel=10)
    assert process.scatter == 0.0
    assert share > 0.5
