"""Where a stage that is shifted, turned and not square lands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ertskin.physics.effects.indenter_offset import RIGID, IndenterOffset
from ertskin.physics.effects.standard import Standard

MIDDLE = np.array([0.05, 0.05])
COMMANDED = np.array([[0.05, 0.05], [0.09, 0.05], [0.05, 0.09]])


def landed(**values: float) -> np.ndarray:
    return IndenterOffset(**values).contact_m(COMMANDED, MIDDLE)


def test_shift_and_turn() -> None:
    assert np.allclose(landed(dx_m=1e-3, dy_m=-2e-3), COMMANDED + np.array([1e-3, -2e-3]))
    c, s = 0.04 * np.cos(0.1), 0.04 * np.sin(0.1)
    assert np.allclose(landed(rotation_rad=0.1), MIDDLE + np.array([[0.0, 0.0], [c, s], [-s, c]]))


def test_axes_that_are_neither_to_scale_nor_square() -> None:
    assert np.allclose(landed(stretch_x=0.05), [[0.05, 0.05], [0.092, 0.05], [0.05, 0.09]])
    assert np.allclose(landed(stretch_y=-0.05), [[0.05, 0.05], [0.09, 0.05], [0.05, 0.088]])
    assert np.allclose(landed(skew_rad=0.1), [[0.05, 0.05], [0.09, 0.05], [0.054, 0.09]])


def test_it_is_looked_for_as_a_rigid_motion_and_freed_to_any_axes() -> None:
    effect = IndenterOffset(dx_m=1e-3)
    (freed,) = effect.freer(RIGID)
    assert freed.effect == effect
    assert set(freed.free) == {*RIGID, "stretch_x", "stretch_y", "skew_rad"}
    assert effect.freer(freed.free) == ()


def test_stated_is_how_far_presses_land_off_on_average() -> None:
    extent_m = np.array([[0.0, 0.0], [0.1, 0.1]])
    known = replace(Standard(np.ones_like, np.nan), pressed_m=COMMANDED, extent_m=extent_m)
    effect = IndenterOffset(dx_m=1e-3, rotation_rad=0.1, stretch_x=0.02)
    shift = (effect.contact_m(COMMANDED, MIDDLE) - COMMANDED).mean(axis=0)
    assert effect.quantities(known) == {"dx_m": pytest.approx(shift[0]), "dy_m": pytest.approx(shift[1])}
    assert abs(shift[0] - 1e-3) > 1e-4
    assert effect.quantities(replace(known, pressed_m=np.zeros((0, 2)))) == {}
