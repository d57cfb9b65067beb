"""The sensing points a network answers for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from omegaconf import DictConfig

from ertskin.errors import UserError
from ertskin.physics.sensor import Sensor, taxel_grid_m
from ertskin.settings import checked, limited

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GridSettings:
    """How many sensing points there are along x and y."""

    columns: int | None = limited(None, least=2)
    rows: int | None = limited(None, least=2)


def grid_m(grid: DictConfig, sensor: Sensor) -> Array:
    """(n,2) points of ``grid.columns`` x ``grid.rows``; the sensor's own taxels where those are null."""
    asked = checked(GridSettings, grid, "grid")
    if asked.columns is None or asked.rows is None:
        if not len(sensor.taxel_m):
            raise UserError("the recording has no taxels of its own: choose a grid, as grid=6x6")
        return sensor.taxel_m
    low, high = sensor.extent_m
    return np.asarray(low + taxel_grid_m(high - low, asked.columns, asked.rows))


def spacing_m(taxel_m: Array) -> float:
    """Median distance from a taxel to its nearest neighbour."""
    apart = np.linalg.norm(taxel_m[:, None] - taxel_m, axis=-1)
    np.fill_diagonal(apart, np.inf)
    return float(np.median(apart.min(axis=1)))
