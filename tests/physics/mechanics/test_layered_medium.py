"""The transform solution against closed forms and conservation."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.physics.mechanics.layered_medium import LayeredMedium
from ertskin.physics.sensor import Layer, Sensor

DEEP = (Layer("top", 0.01, 1e5, 0.3), Layer("rest", 2.0, 1e5, 0.3))


def test_thick_pad_is_boussinesqs_half_space():
    radius = np.array([0.0, 0.005, 0.01, 0.02])
    depth = 0.01
    boussinesq = 3 * depth**3 / (2 * np.pi * (radius**2 + depth**2) ** 2.5)
    assert LayeredMedium(DEEP, 0.03).point_pressure(radius, 0) == pytest.approx(boussinesq, rel=1e-5)


def test_surface_of_a_thick_pad_sinks_as_boussinesqs():
    radius = np.array([1e-3, 5e-3, 1e-2])
    boussinesq = (1 - 0.3**2) / (np.pi * 1e5 * radius)
    fixed_bottom_lifts = (1 - 0.3**2) / (np.pi * 1e5 * 1.0)
    sinking = LayeredMedium(DEEP, 0.03).point_sinking(radius)
    assert sinking == pytest.approx(boussinesq, abs=fixed_bottom_lifts)


def test_mean_sinking_is_the_mean_of_the_sinking():
    medium = LayeredMedium((Layer("foam", 4e-3, 28e3, 0.3),), 0.02)
    disk, offset = 5e-3, 2e-3
    node, weight = np.polynomial.legendre.leggauss(60)
    angle = (np.arange(64) + 0.5) * 2 * np.pi / 64
    # polar around the force, where the sinking's 1/r is tamed by the area element
    far = -offset * np.cos(angle) + np.sqrt(disk**2 - (offset * np.sin(angle)) ** 2)
    radius = 0.5 * far[:, None] * (node + 1)
    integral = (0.5 * far[:, None] * weight * radius * medium.point_sinking(radius)).sum() * 2 * np.pi / 64
    assert medium.mean_sinking(np.array(offset), disk) == pytest.approx(integral / (np.pi * disk**2), rel=1e-8)


def test_uniform_pressure_passes_every_layer_and_squeezes_them_in_series(paper_sensor: Sensor):
    sinking, pressure = LayeredMedium(paper_sensor.layers).spectrum(np.array([1e-3]))
    series = sum(
        layer.thickness_m
        * (1 + layer.poissons_ratio)
        * (1 - 2 * layer.poissons_ratio)
        / ((1 - layer.poissons_ratio) * layer.youngs_modulus_pa)
        for layer in paper_sensor.layers
    )
    assert pressure[:, 0] == pytest.approx(1.0, abs=1e-9)
    assert sinking[0] == pytest.approx(series, rel=1e-9)


def test_every_interface_carries_the_whole_force(paper_sensor: Sensor):
    medium = LayeredMedium(paper_sensor.layers, 0.08)
    edges = np.linspace(0.0, 0.08, 161)
    node, weight = np.polynomial.legendre.leggauss(6)
    half = 0.5 * np.diff(edges)[:, None]
    radius = (0.5 * (edges[1:] + edges[:-1])[:, None] + half * node).ravel()
    area = 2 * np.pi * radius * (half * weight).ravel()
    for interface in range(len(paper_sensor.layers)):
        assert area @ medium.point_pressure(radius, interface) == pytest.approx(1.0, abs=1e-6)


def test_cutting_a_layer_in_two_changes_nothing(paper_sensor: Sensor):
    top, *rest = paper_sensor.layers
    halves = [Layer("half", top.thickness_m / 2, top.youngs_modulus_pa, top.poissons_ratio)] * 2
    k = np.geomspace(1e-2, 1e5, 60)
    sinking, pressure = LayeredMedium(paper_sensor.layers).spectrum(k)
    cut_sinking, cut_pressure = LayeredMedium((*halves, *rest)).spectrum(k)
    assert cut_sinking == pytest.approx(sinking, rel=1e-10)
    assert cut_pressure[1:] == pytest.approx(pressure, rel=1e-9)


def test_single_bonded_layer_has_the_textbook_surface_compliance():
    nu, h, modulus = 0.3, 4e-3, 28e3
    k = np.geomspace(10.0, 2e4, 40)
    x = k * h
    # Kerr & closed form of the elastic layer on a rigid base (e.g. Johnson, Contact Mechanics, 1985, eq. 5.65)
    kappa = 3 - 4 * nu
    shape = (2 * kappa * np.sinh(2 * x) - 4 * x) / (2 * kappa * np.cosh(2 * x) + 4 * x**2 + 1 + kappa**2)
    expected = 2 * (1 - nu**2) / (modulus * k) * shape
    sinking, _ = LayeredMedium((Layer("foam", h, modulus, nu),)).spectrum(k)
    assert sinking == pytest.approx(expected, rel=1e-9)


def test_stable_from_the_flattest_to_the_sharpest_harmonic(paper_sensor: Sensor):
    sinking, pressure = LayeredMedium(paper_sensor.layers).spectrum(np.geomspace(1e-4, 1e7, 200))
    assert np.all(np.isfinite(sinking))
    assert np.all(sinking > 0)
    assert np.all(np.abs(pressure) < 1.5)


@pytest.mark.parametrize("bad", [Layer("a", 0.0, 1e5, 0.3), Layer("a", 1e-3, -1.0, 0.3), Layer("a", 1e-3, 1e5, 0.6)])
def test_impossible_layers_are_refused(bad: Layer):
    with pytest.raises(ValueError, match="layer 'a'"):
        LayeredMedium((bad,))


def test_radius_beyond_the_quadrature_is_refused():
    with pytest.raises(ValueError, match="max_radius_m"):
        LayeredMedium(DEEP, 0.03).point_pressure(np.array([0.04]), 0)
