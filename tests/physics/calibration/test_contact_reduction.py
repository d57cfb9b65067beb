"""The reduced sheet against the full one."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.physics.calibration.contact_reduction import ContactReduction
from ertskin.physics.conduction.sheet import SheetModel

CONTACT = np.array([950.0, 200.0, 420.0, 610.0, 150.0, 880.0, 333.0, 500.0])


@pytest.fixture(scope="module")
def reduction(sheet: SheetModel) -> ContactReduction:
    return ContactReduction.of(sheet, 50 / 18e3, 3000 / 18e3)


def test_unlike_contacts_are_solved_to_far_below_the_noise(sheet: SheetModel, reduction: ContactReduction):
    exact = sheet.solve(sheet.uniform(18e3), CONTACT).pair_resistance_ohm
    assert np.abs(reduction.pair_resistance_ohm(CONTACT, 18e3) - exact).max() < 0.1


def test_error_falls_with_the_number_of_shapes(sheet: SheetModel):
    exact = sheet.solve(sheet.uniform(18e3), CONTACT).pair_resistance_ohm
    errors = [
        np.abs(ContactReduction.of(sheet, 50 / 18e3, 3000 / 18e3, n).pair_resistance_ohm(CONTACT, 18e3) - exact).max()
        for n in (3, 6, 10)
    ]
    assert errors[0] > 5 * errors[1] > 25 * errors[2]


def test_derivatives_are_the_full_models_and_the_difference_quotients(sheet: SheetModel, reduction: ContactReduction):
    _, by_contact, by_sheet = reduction.linearised(CONTACT, 18e3)
    full = sheet.solve(sheet.uniform(18e3), CONTACT).jacobian_contact_resistance()
    assert np.abs(by_contact - full).max() < 2e-3
    step = 1.0
    quotient = (
        reduction.pair_resistance_ohm(CONTACT, 18e3 + step) - reduction.pair_resistance_ohm(CONTACT, 18e3 - step)
    ) / (2 * step)
    assert by_sheet == pytest.approx(quotient, abs=1e-6)


def test_resistances_scale_together(reduction: ContactReduction):
    base = reduction.pair_resistance_ohm(CONTACT, 18e3)
    assert reduction.pair_resistance_ohm(2 * CONTACT, 36e3) == pytest.approx(2 * base, rel=1e-12)
