"""The unloaded sheet resistance varies over the sheet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, SheetEffect, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Signal
from ertskin.physics.effects.smooth_field import Nodes, field_at, spots_over
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor


@dataclass(frozen=True)
class SheetInhomogeneity(SheetEffect):
    """Sheet resistance times exp(g(x)), pressed or not: a Gaussian spot, a slope, a smooth field given by ``nodes``."""

    name: ClassVar[str] = "sheet_inhomogeneity"
    source: ClassVar[str] = "Coating thickness of conductive fabric; log-normal so that it stays positive"
    hypothesis: ClassVar[Hypothesis] = Hypothesis((Axis.PLACE,), (Signal.READINGS,), (), field=True)

    amplitude: float = parameter("1", -2.0, 2.0, 0.0, 0.05, "logarithm of the resistance at the spot's middle")
    x_m: float = parameter("m", -1.0, 1.0, 0.0, 5e-3, "spot's middle", defining=False)
    y_m: float = parameter("m", -1.0, 1.0, 0.0, 5e-3, "spot's middle", defining=False)
    radius_m: float = parameter("m", 2e-3, 1.0, 0.03, 5e-3, "spot's standard deviation", defining=False)
    gradient_x: float = parameter("1", -2.0, 2.0, 0.0, 0.02, "logarithm of the resistance, right end against left")
    gradient_y: float = parameter("1", -2.0, 2.0, 0.0, 0.02, "logarithm of the resistance, top against bottom")
    nodes: Nodes = ()

    def log_resistance(self, position_m: Array, extent_m: Array) -> Array:
        """(N,) natural logarithm of the relative sheet resistance at positions (N,2)."""
        unit = (position_m - extent_m.mean(axis=0)) / (extent_m[1] - extent_m[0])
        squared = ((position_m - np.array([self.x_m, self.y_m])) ** 2).sum(axis=-1)
        spot = self.amplitude * np.exp(-0.5 * squared / self.radius_m**2)
        slope = self.gradient_x * unit[..., 0] + self.gradient_y * unit[..., 1]
        field = field_at(self.nodes, position_m, extent_m) if self.nodes else 0.0
        return np.asarray(spot + slope + field)

    def conductivity_s(self, conductivity_s: Array, position_m: Array, extent_m: Array) -> Array:
        factor = np.exp(-self.log_resistance(position_m, extent_m))
        tensor = conductivity_s.shape[-1] == 3 and conductivity_s.shape[-2] == len(position_m)
        return conductivity_s * (factor[:, None] if tensor else factor)

    def map_at(self, position_m: Array, extent_m: Array) -> Array:
        """(N,) the logarithm of the resistance."""
        return self.log_resistance(position_m, extent_m)

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Standard deviation of the logarithm over the sensing points."""
        if not len(standard.point_m):
            return {}
        return {"log_spread": float(np.std(self.log_resistance(standard.point_m, standard.extent_m)))}

    @property
    def place(self) -> tuple[tuple[float, float], float] | None:
        return ((self.x_m, self.y_m), self.radius_m) if self.amplitude != 0 else None

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        """A slope over the sheet, and spots all over it."""
        slope = ("gradient_x", "gradient_y")
        spots = (cls(x_m=x_m, y_m=y_m, radius_m=radius_m) for x_m, y_m, radius_m in spots_over(sensor.extent_m))
        free = ("amplitude", "x_m", "y_m", "radius_m")
        return Start(cls(), slope, slope), *(Start(spot, free, ("amplitude",)) for spot in spots)
