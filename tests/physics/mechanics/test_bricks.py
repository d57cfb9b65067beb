"""The bricks: patch tests, equilibrium, and the transform solution as the oracle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ertskin.physics.mechanics.brick_element import CORNERS, brick_stiffness
from ertskin.physics.mechanics.bricks import BrickPad, graded_axis_m, quarter_pad
from ertskin.physics.mechanics.layered_medium import LayeredMedium
from ertskin.physics.mechanics.pressure import InterfacePressure
from ertskin.physics.mechanics.refinement import refine_bricks
from ertskin.physics.mechanics.stiffness import sensor_stiffness_n_per_m
from ertskin.physics.sensor import Layer, Sensor

SIZE = np.array([[1.0, 0.7, 0.3]])
STIFFNESS = brick_stiffness(SIZE, np.array([2.0]), np.array([0.3]))[0]


def test_element_is_symmetric_with_exactly_six_rigid_motions():
    value = np.linalg.eigvalsh(STIFFNESS)
    assert np.abs(STIFFNESS - STIFFNESS.T).max() < 1e-14
    assert np.sum(np.abs(value) < 1e-12) == 6
    assert np.all(value[6:] > 1e-3)


@pytest.mark.parametrize(("nu", "modulus"), [(0.0, 1.0), (0.3, 2.0), (0.495, 5.0)])
def test_patch_any_uniform_strain_gives_the_exact_energy(nu: float, modulus: float):
    rng = np.random.default_rng(7)
    gradient = rng.normal(size=(3, 3))
    strain = 0.5 * (gradient + gradient.T)
    shear, lame = modulus / (2 * (1 + nu)), modulus * nu / ((1 + nu) * (1 - 2 * nu))
    stress = 2 * shear * strain + lame * np.trace(strain) * np.eye(3)
    displacement = ((CORNERS * SIZE) @ gradient.T).ravel()
    stiffness = brick_stiffness(SIZE, np.array([modulus]), np.array([nu]))[0]
    assert displacement @ stiffness @ displacement == pytest.approx((stress * strain).sum() * SIZE.prod())


def test_nearly_incompressible_element_does_not_lock():
    """Bending keeps the volume: its energy must stay finite as Poisson's ratio goes to one half."""
    x, y, z = (CORNERS - 0.5).T
    bending = np.stack([x * z, 0 * y, -0.5 * x**2], axis=1).ravel()
    energies = [bending @ brick_stiffness(SIZE, np.ones(1), np.array([nu]))[0] @ bending for nu in (0.4, 0.4999)]
    assert energies[1] == pytest.approx(energies[0], rel=0.2)


def test_uniform_load_on_mirrored_walls_compresses_each_layer_by_its_own_modulus():
    layers = (Layer("soft", 2e-3, 2e4, 0.3), Layer("stiff", 1e-3, 5e5, 0.45), Layer("base", 1e-3, 3e5, 0.4))
    # narrow and mirrored on two sides only: with Poisson's ratio zero the free sides make no difference
    free = tuple(Layer(layer.name, layer.thickness_m, layer.youngs_modulus_pa, 0.0) for layer in layers)
    axis = np.array([0.0, 1e-3, 2.5e-3])
    pad = BrickPad(free, axis, axis, (3, 2, 2), (True, True))
    share = np.array([0.5e-3, 1.25e-3, 0.75e-3])
    loads = np.zeros((*pad.shape, 3))
    loads[:, :, 0, 2] = 1000.0 * np.multiply.outer(share, share)
    displacement = pad.solve(loads.ravel(), tolerance=1e-12)
    expected = 1000.0 * sum(layer.thickness_m / layer.youngs_modulus_pa for layer in free)
    assert displacement[:, :, 0, 2] == pytest.approx(expected, rel=1e-9)
    for interface in (0, 1):
        assert pad.interface_pressure(displacement, interface) == pytest.approx(1000.0, rel=1e-8)


def test_interface_carries_the_whole_force_and_moment(paper_sensor: Sensor):
    axis = np.concatenate([-graded_axis_m(2e-3, 8e-3, 0.04)[:0:-1], graded_axis_m(2e-3, 8e-3, 0.04)])
    pad = BrickPad(paper_sensor.layers, axis, axis, (2, 1, 1, 1, 1))
    at = np.array([[1.3e-3, -0.4e-3]])
    displacement = pad.solve(pad.loads_n(at, np.array([2.0])), tolerance=1e-9)
    forces = pad.nodal_forces_n(displacement, 2)
    assert forces.sum() == pytest.approx(2.0, rel=1e-6)
    centre = np.array([axis @ forces.sum(axis=1), axis @ forces.sum(axis=0)]) / forces.sum()
    # the fabric under the interface also takes shear over a lever of its thickness: not exactly under the force
    assert centre == pytest.approx(at[0], abs=1e-4)


def test_error_falls_with_the_square_of_the_spacing_to_below_one_percent(paper_sensor: Sensor):
    study = refine_bricks(paper_sensor, [9.375e-4, 6.25e-4, 6.25e-4 / 1.5])
    assert study.order == pytest.approx(2.0, abs=0.5)
    assert study.against_exact < 0.01
    assert study.estimated == pytest.approx(study.against_exact, rel=1.0)


def test_kernel_moved_and_superposed_is_the_four_forces_solved_at_once(paper_sensor: Sensor):
    spacing = 0.625e-3
    pad = quarter_pad(paper_sensor, spacing, 0.01, 0.0432)
    points = np.array([[2.5e-3, 0.0], [0.0, 2.5e-3]])
    displacement = pad.solve(pad.loads_n(points, np.full(2, 0.125)))
    direct = pad.interface_pressure(displacement, paper_sensor.piezo_interface)
    superposed = InterfacePressure.from_bricks(paper_sensor, spacing)
    nodes = np.stack(np.meshgrid(pad.x_m, pad.y_m, indexing="ij"), axis=-1)
    assert np.abs(direct - superposed.at(nodes)).max() < 0.005 * direct.max()
    stiffness = 1 / pad.mean_sinking_m(displacement, np.zeros(2), 5e-3)
    assert stiffness == pytest.approx(sensor_stiffness_n_per_m(paper_sensor), rel=0.02)


def test_pad_edge_thirty_millimetres_away_does_not_show(paper_sensor: Sensor):
    """The recordings' pads reach 30 mm beyond the sheet: translation costs nothing there, but much at the very edge."""
    inside = graded_axis_m(1.25e-3, 0.01, 0.04)
    across = quarter_pad(paper_sensor, 1.25e-3, 0.01, 0.04)
    reference = across.interface_pressure(across.solve(across.loads_n(np.zeros((1, 2)), np.array([0.25]))), 2)

    def change(margin_m: float) -> float:
        left = -np.unique(np.minimum(inside, margin_m))[:0:-1]
        axis = np.concatenate([left, inside])
        pad = BrickPad(paper_sensor.layers, axis, inside, across.rows, (False, True))
        pressure = pad.interface_pressure(pad.solve(pad.loads_n(np.zeros((1, 2)), np.array([0.5]))), 2)
        return float(np.abs(pressure[len(left) :] - reference).max() / reference.max())

    assert change(0.03) < 1e-4
    assert change(0.0025) > 0.01


def test_loads_outside_the_grid_are_refused():
    pad = BrickPad((Layer("a", 1e-3, 1e5, 0.3),), np.array([0.0, 1e-3]), np.array([0.0, 1e-3]), (1,))
    with pytest.raises(ValueError, match="outside the pad"):
        pad.loads_n(np.array([[2e-3, 0.0]]), np.array([1.0]))


@pytest.mark.parametrize("poissons_ratio", [0.3, -0.3], ids=["neoprene", "auxetic foam"])
def test_point_pressure_of_bricks_is_that_of_the_transform(paper_sensor: Sensor, poissons_ratio: float):
    foam, *rest = paper_sensor.layers
    paper_sensor = replace(paper_sensor, layers=(replace(foam, poissons_ratio=poissons_ratio), *rest))
    pad = quarter_pad(paper_sensor, 0.625e-3, 0.01, 0.0432)
    displacement = pad.solve(pad.loads_n(np.zeros((1, 2)), np.array([0.25])))
    pressure = pad.interface_pressure(displacement, 2)
    radius = np.hypot(*np.meshgrid(pad.x_m, pad.y_m, indexing="ij"))
    exact = LayeredMedium(paper_sensor.layers, 0.1).point_pressure(radius, 2)
    away = radius > 4e-3
    assert np.abs(pressure - exact)[away].max() < 0.01 * exact.max()
