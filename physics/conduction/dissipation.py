"""Where in a sheet a scan's currents give off their heat."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fftfreq, irfft2, next_fast_len, rfft2, rfftfreq
from scipy.ndimage import map_coordinates
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
MOST_AROUND = 4
"""Sheets' lengths of nothing around the sheet: what spreads farther is all but even in any case."""
NOWHERE = 1e-9
"""Part of the largest area in a cell below which it is the smoothing's rounding."""


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
    area, heat = _spread(np.stack([area, heat]), spread_m / CELL_M)
    bare = area <= NOWHERE * area.max()
    found = heat / np.where(bare, 1.0, area)
    found[bare] = power[cKDTree(place_m).query(low_m + CELL_M * np.argwhere(bare))[1]]
    return found


def _spread(grids: Array, cells: float) -> Array:
    """(n,X,Y) grids smoothed by a Gaussian of this many cells (rms), with nothing around them."""
    shape = grids.shape[1:]
    around = int(min(np.ceil(REACH * cells), MOST_AROUND * max(shape)))
    padded = [next_fast_len(n + around, real=True) for n in shape]
    along = [
        np.exp(-2.0 * (np.pi * cells * frequency(n)) ** 2)
        for n, frequency in zip(padded, (fftfreq, rfftfreq), strict=True)
    ]
    spectrum = rfft2(grids, padded) * np.multiply.outer(*along)
    return np.asarray(irfft2(spectrum, padded)[:, : shape[0], : shape[1]])
