"""Electrodes on the sheet's edge that sit elsewhere along it: shape derivative, and what one thread pulls along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ertskin.diagnosis.linear.sensitivity import PadRims
from ertskin.physics.conduction.mesh import MeshError
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.effects.electrode_displacement import ElectrodeDisplacement
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.rim import arc_position, on_outline
from ertskin.physics.sensor import Sensor, rectangle_m

ELECTRODES, RADIUS_M = 8, 0.05
PROTOCOL = Protocol.against_sink(electrode_pairs(ELECTRODES), ELECTRODES, 1e-3)


@pytest.fixture(scope="module")
def sheet() -> Sensor:
    angle = 2 * np.pi * np.arange(128) / 128
    outline = RADIUS_M * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    first = 16 * np.arange(ELECTRODES)
    return Sensor(outline, 1e3, 20.0, electrode_edge_m=np.stack([outline[first], outline[first + 6]], axis=1))


@pytest.fixture(scope="module")
def rectangle() -> Sensor:
    """Its first electrode lies round a corner."""
    outline = rectangle_m((0.1, 0.06))
    middle = 0.32 * np.arange(ELECTRODES) / ELECTRODES
    ends = on_outline(outline, (middle[:, None] + [-0.004, 0.006]).ravel() % 0.32)
    return Sensor(outline, 1e3, 20.0, electrode_edge_m=ends.reshape(-1, 2, 2))


def scan(sensor: Sensor) -> np.ndarray:
    model = SheetModel(sensor, "fine")
    return PROTOCOL.whitened(model.solve(model.uniform(1e3), np.full(ELECTRODES, 20.0)).pair_resistance_ohm)


@pytest.mark.parametrize(("shape", "electrode"), [("sheet", 0), ("sheet", 5), ("rectangle", 0), ("rectangle", 3)])
def test_the_derivative_by_the_place_is_that_of_sheets_solved_with_it_elsewhere(
    shape: str, electrode: int, request: pytest.FixtureRequest
) -> None:
    sheet: Sensor = request.getfixturevalue(shape)
    model, step_m = SheetModel(sheet, "fine"), 5e-4
    solution = model.solve(model.uniform(1e3), np.full(ELECTRODES, 20.0))
    sides = [ElectrodeDisplacement(electrode, along_m=by_m).geometry(sheet) for by_m in (-step_m, step_m)]
    shift_m = sides[1].electrode_middle_m - sides[0].electrode_middle_m
    expected = np.einsum("plc,lc->p", PadRims(model).sensitivity(solution, PROTOCOL), shift_m)
    found = scan(sides[1]) - scan(sides[0])
    np.testing.assert_allclose(expected, found, atol=0.05 * np.abs(found).max())


def test_a_thread_pulls_its_neighbours_along(sheet: Sensor) -> None:
    moved = ElectrodeDisplacement(0, along_m=2e-3, pulled=0.5).geometry(sheet)
    ends = [arc_position(sheet.outline_m, one.electrode_edge_m[:, 0])[0] for one in (sheet, moved)]
    np.testing.assert_allclose(ends[1] - ends[0], 2e-3 * np.array([1, 0.5, 0, 0, 0, 0, 0, 0.5]), atol=1e-9)
    pads = Sensor(sheet.outline_m, 1e3, 20.0, 0.5 * sheet.electrode_middle_m, np.full((ELECTRODES, 2), 2e-3))
    for side, expected in ((1, [0, 0, 0, 1, 0.5, 0, 0, 0]), (-1, [0, 0, 0.5, 1, 0, 0, 0, 0])):
        inside = ElectrodeDisplacement(3, dx_m=1e-3, pulled=0.5, side=side).geometry(pads)
        shift_m = (inside.electrode_center_m - pads.electrode_center_m)[:, 0]
        assert shift_m == pytest.approx(1e-3 * np.array(expected))


def test_a_thread_pulls_the_nearest_pads_whatever_their_numbers(sheet: Sensor) -> None:
    place_m = 1e-2 * np.array([[0, 0], [3, 0], [0, 3], [1, 0], [3, 3], [0, 1.5], [2, 2], [3, 1]])
    pads = Sensor(sheet.outline_m, 1e3, 20.0, place_m, np.full((ELECTRODES, 2), 2e-3))
    first, *_ = ElectrodeDisplacement.reading_starts(pads, PROTOCOL)
    for side, expected in ((0, [1, 0, 0, 0.5, 0, 0.5, 0, 0]), (1, [1, 0, 0, 0, 0, 0.5, 0, 0])):
        effect = replace(first.effect, dy_m=1e-3, pulled=0.5, side=side)
        shift_m = effect.geometry(pads).electrode_center_m - place_m
        assert shift_m[:, 1] == pytest.approx(1e-3 * np.array(expected))
        assert not shift_m[:, 0].any()
    with pytest.raises(ValueError, match="next_to: 1 electrodes"):
        ElectrodeDisplacement(0, next_to=(1,))


def test_a_thread_may_pull_any_two_of_pads_equally_near(sheet: Sensor) -> None:
    place_m = 1e-2 * np.array([[0, 0], [1, 0], [0, 2], [0, -2], [3, 0], [5, 3], [5, -3], [9, 0]])
    pads = Sensor(sheet.outline_m, 1e3, 20.0, place_m, np.full((ELECTRODES, 2), 2e-3))
    starts = [one.effect for one in ElectrodeDisplacement.reading_starts(pads, PROTOCOL)]
    pulling = [one.next_to for one in starts if one.electrode == 0 and one.pulled]
    assert pulling == [(1, 2), (1, 3)]
    assert [one.electrode for one in starts if not one.pulled] == list(range(ELECTRODES))


def test_it_states_where_the_middle_went(sheet: Sensor) -> None:
    found = ElectrodeDisplacement(0, along_m=2e-3).quantities(Standard(np.ones_like, np.nan, sensor=sheet))
    middle = 2 * np.pi * 3 / 128
    way = 2e-3 * np.array([-np.sin(middle), np.cos(middle)])
    assert (found["dx_m"], found["dy_m"]) == pytest.approx(way, abs=5e-5)
    assert ElectrodeDisplacement(0, dx_m=1e-3).quantities(Standard(np.ones_like, np.nan)) == {}


def test_electrodes_do_not_overlap(sheet: Sensor) -> None:
    with pytest.raises(MeshError, match="overlap"):
        scan(ElectrodeDisplacement(1, along_m=-0.02).geometry(ElectrodeDisplacement(0, along_m=0.02).geometry(sheet)))
    with pytest.raises(ValueError, match="side"):
        ElectrodeDisplacement(0, side=2)


def test_each_kind_of_electrode_moves_its_own_way(sheet: Sensor) -> None:
    with pytest.raises(ValueError, match="along_m"):
        ElectrodeDisplacement(0, dx_m=1e-3).geometry(sheet)
    assert [s.free for s in ElectrodeDisplacement.reading_starts(sheet, PROTOCOL)] == [("along_m",)] * (2 * ELECTRODES)
