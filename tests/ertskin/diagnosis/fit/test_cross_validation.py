"""What terms predict of cells held out, each by a fit of all the others, and how such misfits are counted."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ertskin.diagnosis.fit.cross_validation import log_misfit, refitted

PLACE = np.linspace(-1, 1, 12)
PARTITIONS = [[k] for k in range(6)]


@dataclass
class Line:
    """Stands for the joint fit: readings at twelve places, fitted by polynomials; a skin is its coefficients."""

    reading: np.ndarray
    weight: np.ndarray = field(default_factory=lambda: np.ones(12))
    cells: np.ndarray = field(default_factory=lambda: np.arange(12) // 2)
    family: Any = field(default_factory=lambda: SimpleNamespace(skin=lambda calibration, effects: effects))

    def solve(self, terms: list[Any], calibration: None, steps: int = 15) -> Any:
        kept, count = self.weight > 0, len(terms)
        found = np.linalg.lstsq(np.vander(PLACE[kept], count), self.reading[kept], rcond=None)[0]
        return SimpleNamespace(terms=terms, calibration=None, effects=found)

    def scan_residual(self, skin: np.ndarray) -> np.ndarray:
        return np.asarray((self.reading - np.vander(PLACE, len(skin)) @ skin)[:, None])


def test_a_cell_is_predicted_by_the_others() -> None:
    problem = Line(np.random.default_rng(0).normal(size=12))
    costs = refitted(problem, problem.solve(["mean"], None), PARTITIONS)  # type: ignore[arg-type]
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
