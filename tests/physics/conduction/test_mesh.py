"""The mesh conforms to the outline, the pads and the edge electrodes, and refuses what it can't mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sheets import padded_sheet, small_sheet, tank

from ertskin.physics.conduction.mesh import Grading, MeshError, SheetMesh, inside_polygon, layers, mesh_sheet
from ertskin.physics.conduction.sheet import RESOLUTIONS
from ertskin.physics.sensor import Sensor, rectangle_m

COARSE = Grading(cell_m=4e-3, rim_m=4e-4, growth=4.0)


def quality(mesh: SheetMesh) -> np.ndarray:
    """One plus the cosine of each triangle's largest angle: zero at 180 degrees."""
    corner = mesh.point_m[mesh.triangle]
    side = np.roll(corner, -1, axis=1) - corner
    unit = side / np.linalg.norm(side, axis=2, keepdims=True)
    return (1 - (unit * np.roll(unit, 1, axis=1)).sum(axis=2)).min(axis=1)


def test_pads_and_outline_are_covered_exactly() -> None:
    sensor = padded_sheet()
    mesh = mesh_sheet(sensor, COARSE)
    assert mesh.area_m2.min() > 0
    assert mesh.area_m2.sum() == pytest.approx(0.0144, rel=1e-12)
    covered = np.bincount(mesh.pad + 1, weights=mesh.area_m2)[1:]
    np.testing.assert_allclose(covered, 16e-6, rtol=1e-12)


def test_no_pad_rim_crosses_a_triangle() -> None:
    sensor = small_sheet()
    mesh = mesh_sheet(sensor, COARSE)
    away = np.abs(mesh.point_m[mesh.triangle][:, :, None] - sensor.electrode_center_m) - 0.5 * sensor.electrode_size_m
    inside = (away < -1e-9).all(axis=3).any(axis=1)
    outside = (away > 1e-9).any(axis=3).any(axis=1)
    assert not (inside & outside).any()


def test_cells_are_small_at_the_rim_and_large_elsewhere() -> None:
    mesh = mesh_sheet(padded_sheet(), Grading(cell_m=4e-3, rim_m=1e-4, growth=3.0))
    corner = mesh.point_m[mesh.triangle]
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    assert longest.max() < 1.6 * 4e-3
    width = 2 * mesh.area_m2 / longest
    assert width.min() < 1.01e-4


def test_no_angle_comes_near_180_degrees() -> None:
    for sensor in (padded_sheet(), small_sheet(), tank()):
        mesh = mesh_sheet(sensor, COARSE)
        assert quality(mesh).min() > 0.02


def test_edge_electrodes_are_covered_exactly() -> None:
    sensor = tank()
    mesh = mesh_sheet(sensor, Grading(cell_m=0.02, rim_m=5e-4))
    outline = sensor.outline_m
    side = np.linalg.norm(outline[1] - outline[0])
    for edge, ends in zip(mesh.edge, np.asarray(sensor.electrode_edge_m), strict=True):
        length = np.linalg.norm(mesh.point_m[edge[:, 1]] - mesh.point_m[edge[:, 0]], axis=1).sum()
        assert length == pytest.approx(6 * side, rel=1e-9)
        np.testing.assert_allclose(mesh.point_m[edge[0, 0]], ends[0], atol=1e-9)
        np.testing.assert_allclose(mesh.point_m[edge[-1, 1]], ends[1], atol=1e-9)


def test_an_electrode_may_pass_the_outlines_first_corner() -> None:
    sensor = Sensor(
        rectangle_m((0.1, 0.05)), electrode_edge_m=np.array([[[0.0, 0.01], [0.02, 0.0]], [[0.1, 0.02], [0.1, 0.03]]])
    )
    mesh = mesh_sheet(sensor, Grading(cell_m=5e-3, rim_m=1e-3))
    length = [np.linalg.norm(mesh.point_m[e[:, 1]] - mesh.point_m[e[:, 0]], axis=1).sum() for e in mesh.edge]
    assert length == pytest.approx([0.03, 0.01], rel=1e-9)


def test_an_outline_with_a_notch() -> None:
    outline = np.array([[0, 0], [0.1, 0], [0.1, 0.1], [0.06, 0.1], [0.05, 0.03], [0.04, 0.1], [0, 0.1]])
    sensor = Sensor(outline, 1.0, 1.0, np.array([[0.02, 0.08], [0.08, 0.08]]), np.full((2, 2), 0.01))
    mesh = mesh_sheet(sensor, Grading(cell_m=5e-3, rim_m=1e-3))
    assert mesh.area_m2.sum() == pytest.approx(0.01 - 0.5 * 0.02 * 0.07, rel=1e-12)
    assert inside_polygon(mesh.point_m[mesh.triangle].mean(axis=1), outline).all()


def test_refinement_cuts_in_four_and_keeps_the_electrodes() -> None:
    for sensor in (small_sheet(), tank()):
        mesh = mesh_sheet(sensor, Grading(cell_m=0.01, rim_m=1e-3))
        finer = mesh.refined()
        assert len(finer.triangle) == 4 * len(mesh.triangle)
        np.testing.assert_allclose(finer.area_m2, np.repeat(mesh.area_m2, 4) / 4, rtol=1e-9)
        np.testing.assert_array_equal(finer.pad, np.repeat(mesh.pad, 4))
        for edge, half in zip(mesh.edge, finer.edge, strict=True):
            assert len(half) == 2 * len(edge)
            assert {*half.ravel().tolist()} >= {*edge.ravel().tolist()}


@pytest.mark.parametrize("length", [0.7, 1.0, 3.3, 20.0])
def test_layers_begin_fine_and_end_at_the_length(length: float) -> None:
    offset = layers(length, 1.0, 3.0)
    assert offset[0] == 0.0
    assert offset[-1] == pytest.approx(length, rel=1e-12)
    step = np.diff(offset)
    assert step[0] <= 1.0 + 1e-9
    assert (step[1:] >= step[:-1] * (1 - 1e-9)).all()


@pytest.mark.parametrize("gap_m", [1e-3, 6e-4, 3e-4, 1e-4])
@pytest.mark.parametrize("corner", [False, True])
@pytest.mark.parametrize(
    "grading", [RESOLUTIONS["fine"].grading, Grading(8e-3, 5e-4, 7.0, 0.7)], ids=["fine", "coarse"]
)
def test_a_pad_may_lie_almost_at_the_outline(gap_m: float, corner: bool, grading: Grading) -> None:
    sensor = padded_sheet()
    half_m = 0.5 * float(sensor.electrode_size_m[0, 0])
    center = sensor.electrode_center_m.copy()
    center[0] = half_m + gap_m, half_m + gap_m if corner else 3 * half_m
    mesh = mesh_sheet(replace(sensor, electrode_center_m=center), grading)
    assert mesh.area_m2.sum() == pytest.approx(0.12**2, rel=1e-9)
    assert mesh.area_m2[mesh.pad == 0].sum() == pytest.approx((2 * half_m) ** 2, rel=1e-9)
    assert len(mesh.triangle) < 2e4


@pytest.mark.parametrize("moved", [[0.0055, 0.0045], [0.0, 0.01], [0.2, 0.2]])
def test_pads_that_overlap_or_leave_the_sheet_are_refused(moved: list[float]) -> None:
    sensor = small_sheet()
    center = sensor.electrode_center_m.copy()
    center[4] = moved
    with pytest.raises(MeshError):
        mesh_sheet(replace(sensor, electrode_center_m=center), COARSE)


def test_electrodes_off_the_outline_are_refused() -> None:
    sensor = tank()
    with pytest.raises(MeshError, match="doesn't lie on the outline"):
        mesh_sheet(replace(sensor, electrode_edge_m=0.5 * np.asarray(sensor.electrode_edge_m)), COARSE)


def test_a_clockwise_outline_is_refused() -> None:
    sensor = small_sheet()
    with pytest.raises(MeshError, match="counter-clockwise"):
        mesh_sheet(replace(sensor, outline_m=sensor.outline_m[::-1]), COARSE)


@pytest.mark.parametrize("growth", [1.5, 2.0, 4.0])
def test_layers_fill_any_length(growth: float) -> None:
    for length_m in np.geomspace(1e-5, 0.1, 400):
        offsets = layers(length_m, 1e-3, growth)
        assert offsets[0] == 0.0
        assert offsets[-1] == pytest.approx(length_m)
        assert (np.diff(offsets) > 0).all()
