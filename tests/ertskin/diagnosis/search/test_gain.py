"""What a fit gains over another where cells predict one another, and where they can't."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.levenberg_marquardt import Fit
from ertskin.diagnosis.fit.quadratic import Quadratic
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Modes, Term
from ertskin.diagnosis.search import gain
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity


def fit(cost: list[float], terms: tuple[Term, ...] = (), hessian: np.ndarray | None = None) -> Solved:
    cells = len(cost) + 1
    curved = np.zeros((cells, 1, 1)) if hessian is None else hessian
    quadratic = Quadratic(np.array([*cost, 0.0]), np.zeros(curved.shape[:2]), curved)
    size = curved.shape[1]
    return Solved(None, terms, Fit(np.zeros(size), quadratic, np.eye(size), 1), np.zeros((1, 1)))  # type: ignore[arg-type]


def predicted(monkeypatch: pytest.MonkeyPatch, without: Solved, costs: tuple[list[float], list[float]]) -> None:
    monkeypatch.setattr(
        gain, "held_out", lambda solved, partitions: np.array(costs[0] if solved is without else costs[1])
    )


def test_no_prediction_gains_or_loses_more_than_the_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    without, present = fit([100.0, 100.0, 100.0]), fit([90.0, 80.0, 95.0])
    predicted(monkeypatch, without, ([500.0, 100.0, 100.0], [100.0, 900.0, 97.0]))
    assert gain.gained(without, present, [[0], [1], [2]], DEFAULT) == pytest.approx(10.0 - 20.0 + 3.0)


def test_what_halves_the_misfit_gains_that_however_wild_its_predictions(monkeypatch: pytest.MonkeyPatch) -> None:
    without, present = fit([100.0, 100.0]), fit([10.0, 10.0])
    predicted(monkeypatch, without, ([100.0, 100.0], [1e6, 20.0]))
    assert gain.gained(without, present, [[0], [1]], DEFAULT) == pytest.approx(180.0)


def test_a_smooth_field_pays_for_its_freedom() -> None:
    modes = Modes(np.zeros((2, 2, 2)))
    curved = np.zeros((2, 3, 3))
    curved[0] = np.diag([7.0, 3.0, 15.0])
    solved = fit([1.0], (Term(SheetInhomogeneity(), (), modes, (1.0, -2.0)),), curved)
    assert gain.freedom(solved) == pytest.approx(0.5 * 5.0 + 0.5 * np.log(4.0 * 16.0))
    assert gain.freedom(fit([1.0])) == 0.0


def test_a_smooth_field_gains_no_more_than_its_evidence(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may predict cells as well as two numbers do, and has a hundred."""
    curved = np.zeros((3, 3, 3))
    curved[0] = np.diag([7.0, 3.0, 15.0])
    without = fit([100.0, 100.0])
    present = fit([80.0, 80.0], (Term(SheetInhomogeneity(), (), Modes(np.zeros((2, 2, 2))), (1.0, -2.0)),), curved)
    predicted(monkeypatch, without, ([100.0, 100.0], [80.0, 80.0]))
    assert gain.gained(without, present, [[0], [1]], DEFAULT) == pytest.approx(40.0 - gain.freedom(present))


def test_a_field_told_by_place_gains_its_evidence_whatever_cells_predict(monkeypatch: pytest.MonkeyPatch) -> None:
    curved = np.zeros((3, 2, 2))
    curved[0] = np.diag([7.0, 3.0])
    by_place = Term(SheetInhomogeneity(), (), Modes(np.zeros((1, 2, 2)), by_place=True), (1.0,))
    without, present = fit([100.0, 100.0]), fit([80.0, 80.0], (by_place,), curved)
    predicted(monkeypatch, without, ([100.0, 100.0], [1e6, 1e6]))
    assert gain.gained(without, present, [[0], [1]], DEFAULT) == pytest.approx(40.0 - gain.freedom(present))
