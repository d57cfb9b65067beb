"""Normal pressure at the piezoresistive interface under the model indenter (paper II-B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physics.mechanics.layered_medium import LayeredMedium
from physics.mechanics.radial_kernel import RadialKernel
from physics.sensor import Sensor, four_points_m

Array = NDArray[np.float64]

_SAMPLES = 1200


def indenter_points_m(sensor: Sensor) -> Array:
    """(n,2) offsets of the model indenter's point forces: the sensor's own, or four at half the indenter's radius."""
    if len(sensor.indenter_points_m):
        return np.asarray(sensor.indenter_points_m, dtype=float)
    return four_points_m(sensor.indenter_diameter_m)


@dataclass(frozen=True, eq=False)
class InterfacePressure:
    """Pressure in pascal per newton around the indenter's axis; compression positive.

    ``kernel`` is the field of one point force, ``points_m`` (n,2) the indenter's point forces, each an n-th of the
    force. The pad is taken to reach far beyond every contact, so that the field moves with the indenter unchanged;
    ``physics.mechanics.bricks`` tells what that costs near an edge.
    """

    kernel: RadialKernel
    points_m: Array

    @classmethod
    def from_transform(cls, sensor: Sensor, max_radius_m: float | None = None) -> InterfacePressure:
        """The exact field of the laterally unlimited pad, up to ``max_radius_m`` (twelve times the pad's thickness)."""
        thickness_m = sum(layer.thickness_m for layer in sensor.layers)
        largest = 12 * thickness_m if max_radius_m is None else max_radius_m
        radius = np.linspace(0.0, largest, _SAMPLES)
        medium = LayeredMedium(sensor.layers, largest)
        return cls(
            RadialKernel.through(radius, medium.point_pressure(radius, sensor.piezo_interface)),
            indenter_points_m(sensor),
        )

    def at(self, offset_m: Array) -> Array:
        """(...,) Pa/N at offsets (...,2) in metre from the indenter's axis."""
        offset = np.asarray(offset_m, dtype=float)
        x, y = offset[..., 0], offset[..., 1]
        total = np.zeros(offset.shape[:-1])
        for px, py in self.points_m:
            total += self.kernel.at((x - px) ** 2 + (y - py) ** 2)
        return total / len(self.points_m)

    def gradient(self, offset_m: Array) -> Array:
        """(...,2) derivative of ``at`` with respect to the offset, in Pa/N/m."""
        offset = np.asarray(offset_m, dtype=float)
        total = np.zeros(offset.shape)
        for point in self.points_m:
            apart = offset - point
            total += 2 * apart * self.kernel.derivative((apart**2).sum(axis=-1))[..., None]
        return total / len(self.points_m)

    def radius_m(self, fraction: float = 1e-5) -> float:
        """Distance from the axis beyond which the pressure stays below ``fraction`` of the field's largest value."""
        rings = np.linspace(0.0, self.kernel.radius_m, 2000)
        angles = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
        around = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        largest = np.abs(self.at(rings[:, None, None] * around)).max(axis=1)
        above = np.flatnonzero(largest > fraction * largest.max())
        return float(rings[min(above[-1] + 1, len(rings) - 1)])
