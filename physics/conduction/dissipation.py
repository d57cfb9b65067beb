"""Where in a sheet a scan's currents give off their heat."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import cKDTree

from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution, SheetModel
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

RESOLUTION = Resolution(1, Grading(cell_m=3e-3, rim_m=5e-4, growth=7.0, spread=0.7))
EVEN_OHM_SQ = 1e4
LEAST_OHM = 10.0
"""Contact resistance where the sensor guesses none."""
CELL_M = 5e-4
REACH = 6.0
"""Standard deviations beyond which heat doesn't spread."""


@lru_cache(maxsize=4)
def dissipated(sensor: Sensor, protocol: Protocol) -> tuple[Array, Array, Array]:
    """Middles (E,2) and areas (E,) of a resting even sheet's elements, and the power density (E,) that a scan gives off
    in them, over its mean: int sigma |grad u|^2 by the complete electrode model, to a tenth."""
    model = SheetModel(sensor, RESOLUTION)
    contact_ohm = np.full(protocol.electrodes, max(sensor.contact_resistance_guess_ohm, LEAST_OHM))
    solution = model.solve(model.uniform(EVEN_OHM_SQ), contact_ohm)
    potential_v = solution.potential @ solution.transfer_ohm @ protocol.injection_current_a.T
    gradient = np.einsum("ebd,ebk->edk", model.space.slope, potential_v[model.space.element[:, :3]])
    power, area_m2 = (gradient**2).sum(axis=(1, 2)), model.weight_m2.sum(axis=1)
    return model.quadrature_m.mean(axis=1), area_m2, power / (power @ area_m2 / area_m2.sum())


def heat_at(position_m: Array, sensor: Sensor, protocol: Protocol, spread_m: float) -> Array:
    """(N,) power density at positions (N,2) over its mean, the heat spread sideways by ``spread_m`` (rms)."""
    cells = (np.asarray(position_m) - sensor.extent_m[0]) / CELL_M
    return np.asarray(map_coordinates(_spread_heat(sensor, protocol, spread_m), cells.T, order=1, mode="nearest"))


@lru_cache(maxsize=16)
def _spread_heat(sensor: Sensor, protocol: Protocol, spread_m: float) -> Array:
    """(X,Y) the same on a grid over the sheet's box, remembered: fits ask for it again and again."""
    place_m, area_m2, power = dissipated(sensor, protocol)
    low_m, high_m = sensor.extent_m
    shape = tuple(np.ceil((high_m - low_m) / CELL_M).astype(int) + 1)
    area, heat = np.zeros(shape), np.zeros(shape)
    cell = tuple(np.rint((place_m - low_m) / CELL_M).astype(int).T)
    np.add.at(area, cell, area_m2)
    np.add.at(heat, cell, area_m2 * power)
    area, heat = (gaussian_filter(one, spread_m / CELL_M, mode="constant", truncate=REACH) for one in (area, heat))
    found = heat / np.where(area > 0, area, 1.0)
    empty = np.argwhere(area <= 0)
    found[area <= 0] = power[cKDTree(place_m).query(low_m + CELL_M * empty)[1]]
    return found
