"""A sheet that drifts, between two drifts, against the sheet solved for itself."""

from __future__ import annotations

import numpy as np
import pytest
from sheets import padded_sheet

from ertskin.physics.conduction.drifting import KEPT, STEP, DriftedSheets
from ertskin.physics.conduction.sheet import SheetModel, Solution

CONTACTS_OHM = 300.0


@pytest.fixture(scope="module")
def resting() -> Solution:
    model = SheetModel(padded_sheet(), "fast")
    return model.solve(model.uniform(1e4), np.full(model.electrodes, CONTACTS_OHM))


def pressed(resting: Solution) -> np.ndarray:
    """(E,Q) twice the conductance within 12 mm of the middle."""
    place_m = resting.model.quadrature_m
    near = np.hypot(*np.moveaxis(place_m - place_m.mean(axis=(0, 1)), -1, 0)) < 0.012
    return np.where(near, 2.0, 1.0) * resting.conductivity_s


@pytest.mark.parametrize("log_drift", [-0.043, -0.0051, 0.0, 0.005, 0.1])
def test_it_is_the_sheet_solved_with_its_contacts_divided(resting: Solution, log_drift: float) -> None:
    sheets, sheet_s = DriftedSheets(resting), pressed(resting)
    assert sheets.mostly_untouched(sheet_s)
    expected = resting.model.solve(sheet_s, resting.contact_resistance_ohm / np.exp(log_drift)).pair_resistance_ohm
    found = sheets.pair_resistance_ohm(sheet_s, log_drift)
    assert np.abs(found - expected).max() < 1e-4 * CONTACTS_OHM
    # What is divided shows: a step of drift moves pair resistances by hundreds of times that.
    if abs(log_drift) > STEP:
        still = resting.model.solve(sheet_s, resting.contact_resistance_ohm).pair_resistance_ohm
        assert np.abs(still - expected).max() > 100 * np.abs(found - expected).max()


def test_few_solutions_of_the_untouched_sheet_are_kept(resting: Solution) -> None:
    sheets = DriftedSheets(resting)
    for steps in range(6):
        sheets.pair_resistance_ohm(resting.conductivity_s, (steps + 0.5) * STEP)
    assert len(sheets.kept) <= KEPT


def test_drifts_far_apart_are_solved_by_themselves(resting: Solution) -> None:
    assert DriftedSheets.of(resting, np.linspace(0.0, 0.02, 30)) is not None
    assert DriftedSheets.of(resting, np.linspace(0.0, 1.0, 30)) is None
    assert DriftedSheets.of(resting, np.zeros(30)) is None
