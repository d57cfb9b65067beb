"""The indenter's pressure field and its tabulated kernel."""

from __future__ import annotations

import time

import numpy as np
import pytest

from ertskin.physics.mechanics.layered_medium import LayeredMedium
from ertskin.physics.mechanics.pressure import InterfacePressure
from ertskin.physics.mechanics.radial_kernel import RadialKernel
from ertskin.physics.sensor import Sensor


@pytest.fixture(scope="module")
def pressure(paper_sensor: Sensor) -> InterfacePressure:
    return InterfacePressure.from_transform(paper_sensor)


def test_is_the_mean_of_the_exact_fields_of_its_points(pressure: InterfacePressure, paper_sensor: Sensor):
    offset = np.random.default_rng(0).uniform(-0.02, 0.02, (200, 2))
    medium = LayeredMedium(paper_sensor.layers, 0.05)
    apart = np.linalg.norm(offset[:, None] - pressure.points_m, axis=-1)
    exact = medium.point_pressure(apart, paper_sensor.piezo_interface).mean(axis=1)
    assert pressure.at(offset) == pytest.approx(exact, abs=3e-6 * exact.max())


def test_carries_one_newton_per_newton(pressure: InterfacePressure):
    line = np.linspace(-0.06, 0.06, 481)
    field = pressure.at(np.stack(np.meshgrid(line, line), axis=-1))
    assert field.sum() * (line[1] - line[0]) ** 2 == pytest.approx(1.0, abs=1e-5)


def test_gradient_is_the_difference_quotient(pressure: InterfacePressure):
    offset = np.random.default_rng(1).uniform(-0.01, 0.01, (50, 2))
    step = 1e-5
    quotient = np.stack(
        [(pressure.at(offset + d) - pressure.at(offset - d)) / (2 * step) for d in step * np.eye(2)], axis=-1
    )
    gradient = pressure.gradient(offset)
    assert gradient == pytest.approx(quotient, abs=1e-3 * np.abs(gradient).max())


def test_nothing_beyond_its_radius_of_influence(pressure: InterfacePressure):
    radius = pressure.radius_m(1e-4)
    angle = np.linspace(0, 2 * np.pi, 30)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    largest = pressure.at(np.zeros(2))
    assert np.abs(pressure.at(1.02 * radius * ring)).max() < 1e-4 * largest
    assert np.abs(pressure.at(0.9 * radius * ring)).max() > 1e-4 * largest
    assert np.all(pressure.at(10 * pressure.kernel.radius_m * ring) == 0.0)


def test_a_million_points_take_well_under_a_second(pressure: InterfacePressure):
    offset = np.random.default_rng(2).uniform(-0.03, 0.03, (1_000_000, 2))
    pressure.at(offset)
    start = time.process_time()
    pressure.at(offset)
    assert time.process_time() - start < 0.8


def test_stiffer_foam_hardly_changes_the_pressure(paper_sensor: Sensor, pressure: InterfacePressure):
    """Less than 0.5 % for 20 % in the foam's modulus: force and depth, not the pressure, must tell the modulus."""
    line = np.linspace(-0.02, 0.02, 41)
    offset = np.stack(np.meshgrid(line, line), axis=-1)
    stiffer = InterfacePressure.from_transform(paper_sensor.with_layers(neoprene=1.2 * 28e3)).at(offset)
    change = np.abs(stiffer - pressure.at(offset)).max() / pressure.at(np.zeros(2))
    assert 1e-4 < change < 5e-3


def test_kernel_interpolates_a_gaussian_and_the_mean_of_two():
    radius = np.linspace(0.0, 0.1, 1000)
    kernel = RadialKernel.through(radius, np.exp(-((radius / 5e-3) ** 2)))
    at = np.linspace(0.0, 0.02, 77)
    place, middles = np.stack([at, 0.5 * at], axis=-1), np.array([[0.0, 0.0], [3e-3, -1e-3]])
    each = [np.exp(-((place - middle) ** 2).sum(axis=-1) / 25e-6) for middle in middles]
    assert kernel.mean_around(middles[:1], place) == pytest.approx(each[0], abs=1e-6)
    assert kernel.mean_around(middles, place) == pytest.approx(np.mean(each, axis=0), abs=1e-6)
    assert kernel.derivative(at**2) == pytest.approx(-np.exp(-((at / 5e-3) ** 2)) / 25e-6, rel=1e-3, abs=1.0)


def test_method_is_chosen_by_name(paper_sensor: Sensor, pressure: InterfacePressure):
    offset = np.array([[1e-3, 2e-3]])
    assert InterfacePressure.of(paper_sensor, "transform").at(offset) == pytest.approx(pressure.at(offset), rel=1e-12)
    with pytest.raises(ValueError, match="transform, bricks"):
        InterfacePressure.of(paper_sensor, "springs")
