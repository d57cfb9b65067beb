"""Normal pressure at the piezoresistive interface under the model indenter (paper II-B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_lsq_spline

from ertskin.physics.mechanics.bricks import quarter_pad
from ertskin.physics.mechanics.layered_medium import LayeredMedium
from ertskin.physics.mechanics.radial_kernel import RadialKernel
from ertskin.physics.sensor import Sensor, four_points_m

Array = NDArray[np.float64]

_SAMPLES = 600


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
    ``ertskin.physics.mechanics.bricks`` tells what that costs near an edge.
    """

    kernel: RadialKernel
    points_m: Array

    @classmethod
    def of(cls, sensor: Sensor, method: str = "transform") -> InterfacePressure:
        """The field by ``method``, "transform" or the paper's "bricks"; raises ``ValueError`` for any other name."""
        methods = {"transform": cls.from_transform, "bricks": cls.from_bricks}
        if method not in methods:
            raise ValueError(f"interface pressure by {method!r}: choose one of {', '.join(methods)}")
        return methods[method](sensor)

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

    @classmethod
    def from_bricks(cls, sensor: Sensor, spacing_m: float | None = None) -> InterfacePressure:
        """The paper's finite-element field: a unit point force on bricks of ``spacing_m``, superposed.

        The default spacing, a twelfth of the indenter's radius, errs by 0.8 % of the paper's pad's largest pressure.
        """
        radius_m = 0.5 * sensor.indenter_diameter_m
        thickness_m = sum(layer.thickness_m for layer in sensor.layers)
        spacing = radius_m / 12 if spacing_m is None else spacing_m
        pad = quarter_pad(sensor, spacing, core_m=2 * radius_m, end_m=8 * thickness_m)
        displacement = pad.solve(pad.loads_n(np.zeros((1, 2)), np.array([0.25])))
        pressure = pad.interface_pressure(displacement, sensor.piezo_interface)
        return cls(_radial_mean(pad.x_m, pressure, spacing), indenter_points_m(sensor))

    def at(self, offset_m: Array) -> Array:
        """(...,) Pa/N at offsets (...,2) in metre from the indenter's axis."""
        return self.kernel.mean_around(self.points_m, offset_m)

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


def _radial_mean(axis_m: Array, field: Array, spacing_m: float) -> RadialKernel:
    """The radial kernel nearest to nodal values ``field`` (n,n) of a quarter plane, in the sense of least squares."""
    distance = np.hypot(*np.meshgrid(axis_m, axis_m, indexing="ij")).ravel()
    inside = distance <= axis_m[-1]
    order = np.argsort(distance[inside])
    distance, value = distance[inside][order], field.ravel()[inside][order]
    both, mirrored = np.concatenate([-distance[::-1], distance]), np.concatenate([value[::-1], value])
    inner = axis_m[:-1]
    knots = np.concatenate([-inner[:0:-1], inner])
    ends = np.full(4, distance[-1])
    spline = make_lsq_spline(both, mirrored, np.concatenate([-ends, knots, ends]))
    radius = np.arange(0.0, axis_m[-1], 0.25 * spacing_m)
    return RadialKernel.through(radius, spline(radius))
