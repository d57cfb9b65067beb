"""The imaging Jacobian against solving the sheet with one pixel changed."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.evaluation.yardsticks.imaging_jacobian import imaging_jacobian
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import Sensor, rectangle_m, taxel_grid_m


@pytest.fixture(scope="module")
def model() -> SheetModel:
    centre_m = np.array([[0.01, 0.01], [0.05, 0.01], [0.05, 0.03], [0.01, 0.03], [0.03, 0.02]])
    sensor = Sensor(rectangle_m((0.06, 0.04)), electrode_center_m=centre_m, electrode_size_m=np.full((5, 2), 0.004))
    return SheetModel(sensor, "fast")


def test_pixels_tile_the_sheet(model):
    solution = model.solve(model.uniform(2e3), np.full(5, 100.0))
    jacobian_v, pixel_m = imaging_jacobian(solution, Protocol.against_sink(electrode_pairs(5), 5, 1e-3), columns=12)
    assert jacobian_v.shape == (10, 96)
    np.testing.assert_allclose(pixel_m, taxel_grid_m((0.06, 0.04), 12, 8), atol=1e-9)


def test_a_column_is_the_change_of_one_pixel(model):
    protocol = Protocol.against_sink(electrode_pairs(5), 5, 1e-3)
    conductivity_s = model.uniform(2e3)
    solution = model.solve(conductivity_s, np.full(5, 100.0))
    jacobian_v, pixel_m = imaging_jacobian(solution, protocol, columns=6)
    pixel = 8
    inside = (np.abs(model.quadrature_m - pixel_m[pixel]) <= 0.005).all(axis=-1)
    step_s = 1e-3 * conductivity_s * inside
    ahead = model.solve(conductivity_s + step_s, np.full(5, 100.0)).pair_resistance_ohm
    behind = model.solve(conductivity_s - step_s, np.full(5, 100.0)).pair_resistance_ohm
    expected_v = protocol.whitened(ahead - behind) / (2 * step_s.max())
    assert np.linalg.norm(jacobian_v[:, pixel] - expected_v) < 1e-5 * np.linalg.norm(expected_v)
