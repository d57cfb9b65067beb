"""Foam that gives way and a load cell at its stop make the same forces: how much of them the sheet feels tells."""

from __future__ import annotations

import pytest

from ertskin.diagnosis.force.claims import _misread
from ertskin.physics.effects.foam_softening import FoamSoftening
from ertskin.physics.effects.nonlinear_foam import NonlinearFoam


def test_what_the_sheet_feels_tells_a_load_cell_from_foam() -> None:
    foam = NonlinearFoam(stiffening=-0.1)
    assert _misread(foam, {"carried": (0.8, 0.1)}) == pytest.approx((64 - 4) / 2)
    assert _misread(foam, {"carried": (0.1, 0.1)}) == pytest.approx((1 - 81) / 2)
    assert _misread(foam, {"carried": (0.5, 0.1)}) == pytest.approx(0.0)


def test_no_load_cell_shows_more_force_than_presses_on_it() -> None:
    assert _misread(NonlinearFoam(stiffening=0.1), {"carried": (0.8, 0.1)}) is None


def test_other_foam_is_no_load_cells() -> None:
    assert _misread(FoamSoftening(), {}) is None
