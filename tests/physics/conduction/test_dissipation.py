"""Where a scan's currents give off their heat."""

from __future__ import annotations

import numpy as np
import pytest
from sheets import padded_sheet

from ertskin.physics.conduction.dissipation import dissipated, heat_at
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import Sensor, rectangle_m

LENGTH_M, WIDTH_M = 0.06, 0.02


def strip() -> Sensor:
    """A strip with an electrode along each of its ends."""
    edge = np.array([[[0.0, WIDTH_M], [0.0, 0.0]], [[LENGTH_M, 0.0], [LENGTH_M, WIDTH_M]]])
    return Sensor(rectangle_m((LENGTH_M, WIDTH_M)), 1e4, 10.0, electrode_edge_m=edge)


def test_a_strip_is_heated_alike_everywhere() -> None:
    scan = Protocol.against_sink(np.array([[0, 1]]), 2, 1e-3)
    _, area_m2, power = dissipated(strip(), scan)
    assert area_m2.sum() == pytest.approx(LENGTH_M * WIDTH_M, rel=1e-6)
    np.testing.assert_allclose(power, 1.0, rtol=1e-3)


def test_heat_between_two_pads_is_that_of_a_dipole() -> None:
    pads = np.array([[0.24, 0.25], [0.26, 0.25]])
    sensor = Sensor(rectangle_m((0.5, 0.5)), 1e4, 10.0, pads, np.full((2, 2), 2e-3))
    scan = Protocol.against_sink(np.array([[0, 1]]), 2, 1e-3)
    place = np.array([[0.25, 0.25], [0.25, 0.26], [0.25, 0.27], [0.22, 0.25]])
    away = place[:, None] - pads
    field = away / (away**2).sum(axis=2, keepdims=True)
    dipole = ((field[:, 0] - field[:, 1]) ** 2).sum(axis=1)
    found = heat_at(place, sensor, scan, 1e-3)
    np.testing.assert_allclose(
        found / found[0], dipole / dipole[0], rtol=0.12
    )  # linear elements of 3 mm err by a tenth


def test_the_mean_is_one_and_rims_of_pads_are_warmer_than_the_middle() -> None:
    sensor, scan = padded_sheet(), Protocol.against_sink(electrode_pairs(24), 24, 1e-4)
    _, area_m2, power = dissipated(sensor, scan)
    assert (power @ area_m2) / area_m2.sum() == pytest.approx(1.0)
    pad, middle = heat_at(np.array([[0.0425, 0.04], [0.06, 0.06]]), sensor, scan, 1e-3)
    assert pad > 2 * middle


def test_heat_that_spreads_far_is_the_same_everywhere() -> None:
    scan = Protocol.against_sink(electrode_pairs(24), 24, 1e-4)
    place = np.random.default_rng(0).uniform(0.01, 0.11, (20, 2))
    np.testing.assert_allclose(heat_at(place, padded_sheet(), scan, 1.0), 1.0, rtol=0.01)
