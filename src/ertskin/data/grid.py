"""The sensing points a network answers for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from omegaconf import DictConfig

from ertskin.errors import UserError
from physics.sensor import Sensor, taxel_grid_m

Array = NDArray[np.float64]


def grid_m(grid: DictConfig, sensor: Sensor) -> Array:
    """(n,2) points of ``grid.columns`` x ``grid.rows``; the sensor's own taxels where those are null."""
    if grid.columns is None or grid.rows is None:
        if not len(sensor.taxel_m):
            raise UserError("the recording has no taxels of its own: choose a grid, as grid=6x6")
        return sensor.taxel_m
    low, high = sensor.extent_m
    return np.asarray(low + taxel_grid_m(high - low, int(grid.columns), int(grid.rows)))


def spacing_m(taxel_m: Array) -> float:
    """Median distance from a taxel to its nearest neighbour."""
    apart = np.linalg.norm(taxel_m[:, None] - taxel_m, axis=-1)
    np.fill_diagonal(apart, np.inf)
    return float(np.median(apart.min(axis=1)))
