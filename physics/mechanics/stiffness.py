"""Force against depth of the indenter on the pad, its support in series (paper III-B, eq. 4).

Under a point force the surface sinks without bound, so the indenter's depth needs a definition. Here it is the surface
sinking averaged over the indenter's footprint (a disk of its diameter) while the model's point forces press: finite,
independent of a mesh, and the work-conjugate of the uniform pressure that the points stand for. Any other definition
rescales the fitted moduli and leaves the interface pressure nearly as it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.mechanics.layered_medium import LayeredMedium
from ertskin.physics.mechanics.pressure import indenter_points_m
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]


def sensor_stiffness_n_per_m(sensor: Sensor) -> float:
    """k_sen: force over footprint-mean sinking of the laterally unlimited pad, in newton per metre."""
    offset_m = np.linalg.norm(indenter_points_m(sensor), axis=1)
    medium = LayeredMedium(sensor.layers, max_radius_m=sensor.indenter_diameter_m)
    return 1.0 / float(medium.mean_sinking(offset_m, 0.5 * sensor.indenter_diameter_m).mean())


def in_series(sensor_n_per_m: float, indenter_n_per_m: float) -> float:
    """k_tot of eq. 4: 1/k_tot = 1/k_ind + 1/k_sen. An infinitely stiff support leaves k_sen."""
    return 1.0 / (1.0 / sensor_n_per_m + 1.0 / indenter_n_per_m)


def force_n(depth_m: Array, sensor_n_per_m: float, indenter_n_per_m: float) -> Array:
    """(...,) load-cell force in newton at commanded stage depths (...,) in metre."""
    return in_series(sensor_n_per_m, indenter_n_per_m) * np.asarray(depth_m, dtype=float)


def depth_m(force_n: Array, sensor_n_per_m: float, indenter_n_per_m: float) -> Array:
    """(...,) commanded stage depth in metre that gives load-cell forces (...,) in newton."""
    return np.asarray(force_n, dtype=float) / in_series(sensor_n_per_m, indenter_n_per_m)


def sensor_depth_m(stage_depth_m: Array, force_n: Array, indenter_n_per_m: float) -> Array:
    """(...,) the sensor's share of the stage's depth: what is left when the support's yielding F/k_ind is taken off."""
    return np.asarray(stage_depth_m, dtype=float) - np.asarray(force_n, dtype=float) / indenter_n_per_m
