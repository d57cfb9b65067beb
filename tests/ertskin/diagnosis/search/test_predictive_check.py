"""Terms that spoil cells held out go, by fits of all the other cells; those that predict them stay."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.cross_validation import log_misfit, refitted
from ertskin.diagnosis.search import predictive_check
from ertskin.diagnosis.search.chosen import Selection
from ertskin.diagnosis.search.predictive_check import that_predicts

PLACE = np.linspace(-1, 1, 12)
PARTITIONS = [[k] for k in range(6)]


@dataclass
class Line:
    """Stands for the joint fit: readings at twelve places, fitted by polynomials; a skin is its coefficients."""

    reading: np.ndarray
    weight: np.ndarray = field(default_factory=lambda: np.ones(12))
    cells: np.ndarray = field(default_factory=lambda: np.arange(12) // 2)
    family: Any = field(default_factory=lambda: SimpleNamespace(skin=lambda calibration, effects: effects))
    evidence: Any = field(default_factory=lambda: SimpleNamespace(criteria=DEFAULT, scan_v=np.zeros((12, 1))))
    cell_count: int = 6

    def solve(self, terms: list[Any], calibration: None, steps: int = 15) -> Any:
        kept, count = self.weight > 0, len(terms)
        found = np.linalg.lstsq(np.vander(PLACE[kept], count), self.reading[kept], rcond=None)[0]
        residual = np.where(kept, self.reading - np.vander(PLACE, count) @ found, 0.0)[:, None]
        cost = np.bincount(self.cells, 0.5 * residual[:, 0] ** 2)
        fit = SimpleNamespace(quadratic=SimpleNamespace(cost=cost))
        return SimpleNamespace(terms=terms, calibration=None, effects=found, scan_residual=residual, fit=fit)

    def scan_residual(self, skin: np.ndarray) -> np.ndarray:
        return np.asarray((self.reading - np.vander(PLACE, len(skin)) @ skin)[:, None])


def powers(count: int, by_place: int = 0) -> list[Any]:
    """So many terms, the last few of them told place by place."""
    return [SimpleNamespace(by_place=k >= count - by_place) for k in range(count)]


def chosen_of(monkeypatch: pytest.MonkeyPatch, reading: np.ndarray, order: int, by_place: int = 0) -> Selection:
    problem = Line(reading)
    monkeypatch.setattr(predictive_check, "held_out", lambda solved, partitions: np.full(6, np.inf))
    before, after = problem.solve(powers(1), None), problem.solve(powers(order, by_place), None)
    selection = Selection(before, after, ("a term",), problem, ())  # type: ignore[arg-type]
    return that_predicts(selection, PARTITIONS)


def noise() -> np.ndarray:
    return np.random.default_rng(0).normal(size=12)


def test_a_cell_is_predicted_by_the_others() -> None:
    problem = Line(noise())
    costs = refitted(problem, problem.solve(powers(1), None), PARTITIONS)  # type: ignore[arg-type]
    for k, cost in enumerate(costs):
        out = problem.cells == k
        rest = problem.reading[~out].mean()
        assert cost == pytest.approx(0.5 * float(((problem.reading[out] - rest) ** 2).sum()))


def test_where_cells_are_missed_by_the_noise_a_log_misfit_changes_as_half_chi_square() -> None:
    numbers = np.array([400.0, 300.0, 500.0])
    change = np.array([2.0, -1.0, 3.0])
    moved = log_misfit(numbers / 2 + change, numbers) - log_misfit(numbers / 2, numbers)
    assert moved == pytest.approx(change.sum(), rel=0.02)


def test_the_one_cell_that_no_other_tells_of_does_not_outweigh_them() -> None:
    numbers = np.full(6, 1000.0)
    tame, free = np.array([1.1, 1.1, 1.2, 1.1, 8.3, 1.5]), np.array([3.1, 1.6, 1.9, 1.1, 5.5, 1.3])
    assert (tame**2).sum() > (free**2).sum()
    assert log_misfit(numbers / 2 * tame**2, numbers) < log_misfit(numbers / 2 * free**2, numbers)


def test_terms_that_predict_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    assert chosen_of(monkeypatch, 20 * PLACE + noise(), 2).chosen


def test_terms_that_spoil_go_though_they_fit_better(monkeypatch: pytest.MonkeyPatch) -> None:
    left = chosen_of(monkeypatch, noise(), 9)
    assert not left.chosen
    assert left.after is left.before


def test_what_is_told_place_by_place_has_no_cells_to_predict(monkeypatch: pytest.MonkeyPatch) -> None:
    assert chosen_of(monkeypatch, noise(), 9, by_place=8).chosen
    assert not chosen_of(monkeypatch, noise(), 9, by_place=1).chosen


def test_what_a_step_from_the_fit_predicts_well_enough_is_fitted_no_further(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = Line(20 * PLACE + noise())
    selection = Selection(problem.solve(powers(1), None), problem.solve(powers(2), None), ("a term",), problem, ())  # type: ignore[arg-type]
    monkeypatch.setattr(predictive_check, "held_out", lambda solved, partitions: np.ones(6))
    monkeypatch.setattr(predictive_check, "refitted", lambda *given: pytest.fail("fitted"))
    assert that_predicts(selection, PARTITIONS) is selection


def test_what_no_network_explains_has_no_part_in_what_a_step_predicts(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = Line(20 * PLACE + noise())
    before, after = problem.solve(powers(1), None), problem.solve(powers(2), None)
    after.fit.quadratic.cost += 1e4
    selection = Selection(before, after, ("a term",), problem, ())  # type: ignore[arg-type]
    monkeypatch.setattr(predictive_check, "held_out", lambda solved, partitions: np.full(6, 1e4 + 1.0))
    monkeypatch.setattr(predictive_check, "refitted", lambda *given: pytest.fail("fitted"))
    assert that_predicts(selection, PARTITIONS) is selection
