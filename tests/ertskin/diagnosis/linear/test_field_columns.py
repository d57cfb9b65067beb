"""Derivatives by fields over the sheet, found from even fields alone, against differences of the linearised skin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from small_skin import SMALL, small_law, small_sensor, two_presses

from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.field_over_sheet import FieldOverSheet
from ertskin.physics.effects.indenter_offset import IndenterOffset
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.scan_skew import ScanSkew
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity
from ertskin.physics.effects.smooth_field import field_design
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

PAIRS = electrode_pairs(6)
SCAN = Protocol.against_sink(PAIRS, 6, 1e-4, injection_offset_s=np.linspace(0.0, 0.4, len(PAIRS)))
SHAPE = (3, 4)
BY = 1e-4


@pytest.fixture(scope="module")
def history() -> History:
    return two_presses()


@pytest.mark.parametrize(
    "kind",
    [SheetInhomogeneity, PiezoInhomogeneity, partial(PiezoInhomogeneity, in_response=0.7)],
    ids=["sheet", "sensitivity", "sensitivity in the response"],
)
@pytest.mark.parametrize("moving", [False, True])
def test_columns_are_the_differences_that_each_field_makes(
    kind: Callable[..., FieldOverSheet], moving: bool, history: History
) -> None:
    skew = (ScanSkew(speed_m_per_s=1e-3),) if moving else ()
    skin = Skin.build(small_sensor(), SCAN, small_law(), np.linspace(200.0, 900.0, 6), 9000.0, skew, SMALL)
    linear = LinearSkin(skin, history, np.nan_to_num(skin.force_n(history)), np.arange(len(history)), None)
    varied = kind(amplitude=0.2, x_m=0.02, y_m=0.02, radius_m=0.01)
    others = (PiezoHysteresis(width=0.1), *skew)
    unraised, raised = (replace(skin, effects=(*others, effect)) for effect in (varied, varied.raised(BY)))
    extent_m = skin.sensor.extent_m
    fields = partial(field_design, SHAPE, extent_m=extent_m)
    found = np.zeros((*linear.scans(unraised).shape, SHAPE[0] * SHAPE[1]))
    for rows, columns in linear.field_columns(unraised, raised, BY, fields):
        found[rows] = columns
    for k in (0, 5, 11):
        nodes = tuple(map(tuple, (BY * np.eye(SHAPE[0] * SHAPE[1])[k]).reshape(SHAPE).tolist()))
        moved = replace(skin, effects=(*others, replace(varied, nodes=nodes)))
        difference = (linear.scans(moved) - linear.scans(unraised)) / BY
        assert np.abs(difference).max() > 0
        np.testing.assert_allclose(found[..., k], difference, atol=5e-3 * np.abs(found).max())


@pytest.mark.parametrize("kind", [SheetInhomogeneity, PiezoInhomogeneity], ids=["sheet", "sensitivity"])
def test_nothing_remembered_of_other_skins_is_taken(kind: type[FieldOverSheet], history: History) -> None:
    skin = Skin.build(small_sensor(), SCAN, small_law(), np.linspace(200.0, 900.0, 6), 9000.0, (), SMALL)
    varied = kind(amplitude=0.2, x_m=0.02, y_m=0.02, radius_m=0.01)
    fields = partial(field_design, SHAPE, extent_m=skin.sensor.extent_m)

    def linearised() -> LinearSkin:
        return LinearSkin(skin, history, np.nan_to_num(skin.force_n(history)), np.arange(len(history)), None)

    def columns(linear: LinearSkin, *others: Effect, kind: FieldOverSheet = varied) -> list[np.ndarray]:
        before, after = (replace(skin, effects=(*others, effect)) for effect in (kind, kind.raised(BY)))
        return [found for _, found in linear.field_columns(before, after, BY, fields)]

    wanted = columns(linearised(), PiezoHysteresis(width=0.1))
    used = linearised()
    columns(used, PiezoHysteresis(width=0.3))
    columns(used, PiezoHysteresis(width=0.1), kind=replace(varied, amplitude=-0.3))
    used.scans(replace(skin, effects=(PiezoHysteresis(width=0.1), IndenterOffset(dx_m=1e-3), varied)))
    for found, one in zip(columns(used, PiezoHysteresis(width=0.1)), wanted, strict=True):
        np.testing.assert_array_equal(found, one)


def test_a_line_between_the_coarse_grids_nodes_is_seen(history: History) -> None:
    skin = Skin.build(small_sensor(), SCAN, small_law(), np.linspace(200.0, 900.0, 6), 9000.0, (), SMALL)
    linear = LinearSkin(skin, history, np.nan_to_num(skin.force_n(history)), np.arange(len(history)), None)
    changes = []
    for offset_m in np.linspace(-2.5e-3, 2.5e-3, 5):
        line = SheetInhomogeneity(ridge=0.2, offset_m=float(offset_m), width_m=3e-3, edge_m=5e-4)
        seen = linear.scans(replace(skin, effects=(line,)))[0] - linear.scans(skin)[0]
        changes.append(np.sqrt(np.mean(seen**2)))
    assert max(changes) < 1.5 * min(changes)
