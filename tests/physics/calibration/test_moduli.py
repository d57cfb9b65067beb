"""Moduli from force and depth: the valley, its bottom, and what it can't tell."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.physics.calibration.moduli import (
    error_surface,
    fit_moduli,
    measured_stiffness,
    moduli_groups,
    with_moduli,
)
from ertskin.physics.mechanics.stiffness import depth_m, sensor_stiffness_n_per_m
from ertskin.physics.sensor import Sensor

SUPPORT = 9000.0


def indentation(sensor: Sensor, noise_n: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(depth, force, press) of 20 presses of 8 depths on a linear pad."""
    stiffness = sensor_stiffness_n_per_m(sensor)
    depth = np.tile(np.arange(1, 9) * 5e-4, 20)
    force = depth / depth_m(np.array(1.0), stiffness, SUPPORT)
    noise = noise_n * np.random.default_rng(seed).standard_normal(depth.size)
    return depth, force + noise, np.repeat(np.arange(20), 8)


def test_groups_are_the_papers_two_unknowns(skin: Sensor):
    assert moduli_groups(skin) == {
        "neoprene": ("neoprene",),
        "patch_fabric": ("patch_fabric", "sheet_fabric", "base_fabric"),
    }


def test_recovers_the_foam_when_the_fabric_is_as_nominal(skin: Sensor):
    truth = skin.with_layers(neoprene=45e3)
    groups = {"neoprene": ("neoprene",)}
    depth, force, press = indentation(truth, 0.01)
    fit = fit_moduli(skin, groups, depth, force, SUPPORT, press)
    assert fit.stiffness_n_per_m == pytest.approx(sensor_stiffness_n_per_m(truth), rel=1e-3)
    assert fit.moduli_pa[0] == pytest.approx(45e3, rel=5 * fit.modulus_relative_error)


def test_only_one_combination_is_fixed(skin: Sensor):
    depth, force, press = indentation(skin, 0.01)
    fit = fit_moduli(skin, moduli_groups(skin), depth, force, SUPPORT, press)
    assert fit.eigenvalues[1] < 1e-9 * fit.eigenvalues[0]
    assert abs(fit.eigenvectors[0, 0]) > 0.99
    assert fit.moduli_pa == pytest.approx([28e3, 344e3], rel=0.01)


def test_stiffness_error_is_calibrated(skin: Sensor):
    truth = sensor_stiffness_n_per_m(skin)
    depth, force, press = indentation(skin, 0.0)
    scores = []
    for seed in range(200):
        noise = 0.02 * np.random.default_rng(seed).standard_normal(force.size)
        stiffness, error = measured_stiffness(depth, force + noise, SUPPORT, press)
        scores.append((stiffness - truth) / error)
    assert np.std(scores) == pytest.approx(1.0, abs=0.2)


def test_error_surface_is_a_valley_through_the_fit(skin: Sensor):
    depth, force, _ = indentation(skin, 0.0)
    groups = moduli_groups(skin)
    axes = np.geomspace(14e3, 56e3, 9), np.geomspace(172e3, 688e3, 5)
    surface = error_surface(skin, groups, axes, depth, force, SUPPORT)
    assert surface.rms_m.shape == (9, 5)
    lowest = axes[0][surface.rms_m.argmin(axis=0)]
    assert np.all(np.abs(np.log(lowest / 28e3)) < 0.2)
    assert surface.rms_m[4, 2] < 1e-8
    along, across = np.ptp(surface.rms_m[4]), np.ptp(surface.rms_m[:, 2])
    assert along < 0.1 * across


def test_nothing_pressed_is_refused(skin: Sensor):
    with pytest.raises(ValueError, match="at least two frames"):
        fit_moduli(skin, moduli_groups(skin), np.zeros(5), np.zeros(5), SUPPORT)


def test_out_of_reach_stiffness_is_refused(skin: Sensor):
    depth = np.linspace(1e-4, 1e-3, 10)
    with pytest.raises(ValueError, match="no moduli"):
        fit_moduli(skin, {"base_fabric": ("base_fabric",)}, depth, 5e3 * depth, np.inf)


def test_with_moduli_sets_every_layer_of_a_group(skin: Sensor):
    changed = with_moduli(skin, moduli_groups(skin), np.array([1e4, 2e5]))
    assert [layer.youngs_modulus_pa for layer in changed.layers] == [1e4, 1e6, 2e5, 2e5, 2e5]
