"""Where in a sheet a scan's currents give off their heat."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution, SheetModel
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

RESOLUTION = Resolution(1, Grading(cell_m=3e-3, rim_m=5e-4, growth=7.0, spread=0.7))
EVEN_OHM_SQ = 1e4
LEAST_OHM = 10.0
"""Contact resistance where the sensor guesses none."""
TOGETHER = 1 << 22
"""Distances that are held at once."""


@lru_cache(maxsize=4)
def dissipated(sensor: Sensor, protocol: Protocol) -> tuple[Array, Array, Array]:
    """Middles (E,2) and areas (E,) of a resting even sheet's elements, and the power density (E,) that a scan gives off
    in them, over its mean: int sigma |grad u|^2 by the complete electrode model."""
    model = SheetModel(sensor, RESOLUTION)
    contact_ohm = np.full(protocol.electrodes, max(sensor.contact_resistance_guess_ohm, LEAST_OHM))
    solution = model.solve(model.uniform(EVEN_OHM_SQ), contact_ohm)
    potential_v = solution.potential @ solution.transfer_ohm @ protocol.injection_current_a.T
    gradient = np.einsum("ebd,ebk->edk", model.space.slope, potential_v[model.space.element[:, :3]])
    power, area_m2 = (gradient**2).sum(axis=(1, 2)), model.weight_m2.sum(axis=1)
    return model.quadrature_m.mean(axis=1), area_m2, power / (power @ area_m2 / area_m2.sum())


def heat_at(position_m: Array, sensor: Sensor, protocol: Protocol, spread_m: float) -> Array:
    """(N,) power density at positions (N,2) over its mean, the heat spread sideways by ``spread_m`` (rms)."""
    return _heat_at(np.ascontiguousarray(position_m, dtype=float).tobytes(), sensor, protocol, spread_m)


@lru_cache(maxsize=32)
def _heat_at(positions: bytes, sensor: Sensor, protocol: Protocol, spread_m: float) -> Array:
    """The same, remembered: fits ask for it at the same places again and again."""
    position_m = np.frombuffer(positions).reshape(-1, 2)
    place_m, area_m2, power = dissipated(sensor, protocol)
    found = np.empty(len(position_m))
    for few in np.array_split(np.arange(len(position_m)), 1 + len(position_m) * len(place_m) // TOGETHER):
        square = ((position_m[few, None] - place_m) ** 2).sum(axis=2)
        weight = area_m2 * np.exp(-0.5 * (square - square.min(axis=1, keepdims=True)) / spread_m**2)
        found[few] = weight @ power / weight.sum(axis=1)
    found.flags.writeable = False
    return found
