"""Force and depth with the support in series."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ertskin.physics.mechanics.stiffness import depth_m, force_n, in_series, sensor_depth_m, sensor_stiffness_n_per_m
from ertskin.physics.sensor import Layer, Sensor


def test_series_is_the_papers_equation_four():
    total = in_series(709.0, 9000.0)
    assert 1 / total == pytest.approx(1 / 709.0 + 1 / 9000.0)
    assert in_series(709.0, np.inf) == pytest.approx(709.0)


def test_force_and_depth_are_inverse_and_the_support_takes_its_share():
    depth = np.linspace(0, 4e-3, 9)
    force = force_n(depth, 709.0, 9000.0)
    assert depth_m(force, 709.0, 9000.0) == pytest.approx(depth)
    assert sensor_depth_m(depth, force, 9000.0) == pytest.approx(force / 709.0)


def test_stiffness_is_proportional_to_the_moduli(paper_sensor: Sensor):
    doubled = replace(
        paper_sensor,
        layers=tuple(replace(layer, youngs_modulus_pa=2 * layer.youngs_modulus_pa) for layer in paper_sensor.layers),
    )
    assert sensor_stiffness_n_per_m(doubled) == pytest.approx(2 * sensor_stiffness_n_per_m(paper_sensor))


def test_small_indenter_on_a_deep_pad_is_the_half_spaces():
    """Force at the centre of a disk of radius a: mean sinking 2 (1 - nu^2)/(pi E a) on a half-space."""
    sensor = Sensor(
        np.zeros((4, 2)),
        layers=(Layer("foam", 5.0, 1e5, 0.3),),
        indenter_diameter_m=2e-3,
        indenter_points_m=np.array([[0.0, 0.0]]),
    )
    assert sensor_stiffness_n_per_m(sensor) == pytest.approx(np.pi * 1e5 * 1e-3 / (2 * (1 - 0.09)), rel=1e-3)


def test_paper_pad_is_held_by_its_foam(paper_sensor: Sensor):
    base = sensor_stiffness_n_per_m(paper_sensor)
    foam = sensor_stiffness_n_per_m(paper_sensor.with_layers(neoprene=1.1 * 28e3))
    fabric = sensor_stiffness_n_per_m(
        paper_sensor.with_layers(patch_fabric=1.1 * 344e3, sheet_fabric=1.1 * 344e3, base_fabric=1.1 * 344e3)
    )
    assert foam / base > 1.09
    assert fabric / base < 1.005
