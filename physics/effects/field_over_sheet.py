"""A property that varies over the sheet: hills, lines, steps, slopes, and a field given by its values on a grid."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from ertskin.physics.effects.effect import Array, Effect, Start, parameter
from ertskin.physics.effects.smooth_field import Nodes, field_at, lines_over, spots_over
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

OF_SPOT = ("amplitude", "x_m", "y_m", "radius_m")
OF_LINE = ("ridge", "angle_rad", "offset_m", "width_m")
OF_STEP = ("step", "angle_rad", "offset_m", "edge_m")


@dataclass(frozen=True)
class FieldOverSheet(Effect):
    """A factor's logarithm g(x): a Gaussian spot, a line or a step across the sheet, a slope, a smooth field ``nodes``.

    The line lies where (x - middle) . n = ``offset_m``, n at ``angle_rad`` against x. With u the distance from it,
    ``ridge`` (tanh((u + width/2)/edge) - tanh((u - width/2)/edge)) / 2 / tanh(width/2/edge) is a strip and
    ``step`` tanh(u/edge) / 2 what differs on its two sides. ``gradient_x``, ``gradient_y``: change from one end of the
    sheet to the other.
    """

    amplitude: float = parameter("1", -2.0, 2.0, 0.0, 0.1, "logarithm of the factor at the spot's middle")
    x_m: float = parameter("m", -1.0, 1.0, 0.0, 5e-3, "spot's middle", defining=False)
    y_m: float = parameter("m", -1.0, 1.0, 0.0, 5e-3, "spot's middle", defining=False)
    radius_m: float = parameter("m", 2e-3, 1.0, 0.03, 5e-3, "spot's standard deviation", defining=False)
    gradient_x: float = parameter("1", -2.0, 2.0, 0.0, 0.05, "logarithm of the factor, right end against left")
    gradient_y: float = parameter("1", -2.0, 2.0, 0.0, 0.05, "logarithm of the factor, top against bottom")
    ridge: float = parameter("1", -2.0, 2.0, 0.0, 0.1, "logarithm of the factor along the line's middle")
    step: float = parameter("1", -2.0, 2.0, 0.0, 0.1, "logarithm of the factor beyond the line, against before it")
    angle_rad: float = parameter("rad", -4.0, 4.0, 0.0, 0.1, "direction across the line, against x", defining=False)
    offset_m: float = parameter("m", -1.0, 1.0, 0.0, 2e-3, "from the sheet's middle to the line", defining=False)
    width_m: float = parameter("m", 2e-3, 1.0, 6e-3, 2e-3, "the line's width", defining=False)
    edge_m: float = parameter("m", 5e-4, 0.1, 2e-3, 1e-3, "how softly line and step begin", defining=False)
    nodes: Nodes = ()

    has_a_mean: ClassVar[bool] = True
    """False where the calibration makes up for a factor alike everywhere."""

    def logarithm(self, position_m: Array, extent_m: Array) -> Array:
        """(N,) natural logarithm of the factor at positions (N,2) of a sheet with the box ``extent_m`` (2,2)."""
        from_middle = position_m - extent_m.mean(axis=0)
        unit = from_middle / (extent_m[1] - extent_m[0])
        squared = ((position_m - np.array([self.x_m, self.y_m])) ** 2).sum(axis=-1)
        spot = self.amplitude * np.exp(-0.5 * squared / self.radius_m**2)
        slope = self.gradient_x * unit[..., 0] + self.gradient_y * unit[..., 1]
        field = field_at(self.nodes, position_m, extent_m) if self.nodes else 0.0
        return np.asarray(spot + slope + field + self._across(from_middle))

    def _across(self, from_middle_m: Array) -> Array | float:
        if self.ridge == 0 and self.step == 0:
            return 0.0
        apart = from_middle_m @ np.array([np.cos(self.angle_rad), np.sin(self.angle_rad)]) - self.offset_m
        half, edge = 0.5 * self.width_m, self.edge_m
        strip = np.tanh((apart + half) / edge) - np.tanh((apart - half) / edge)
        return np.asarray(0.5 * (self.ridge * strip / np.tanh(half / edge) + self.step * np.tanh(apart / edge)))

    def raised(self, evenly: float) -> Self:
        """The same with the field's logarithm this much more everywhere."""
        nodes = tuple(tuple(value + evenly for value in row) for row in self.nodes or ((0.0, 0.0), (0.0, 0.0)))
        return replace(self, nodes=nodes)

    def map_at(self, position_m: Array, extent_m: Array) -> Array:
        """(N,) the factor's logarithm."""
        return self.logarithm(position_m, extent_m)

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Standard deviation of the logarithm over the sensing points."""
        if not len(standard.point_m):
            return {}
        return {"log_spread": float(np.std(self.logarithm(standard.point_m, standard.extent_m)))}

    @property
    def place(self) -> tuple[tuple[float, float], float] | None:
        return ((self.x_m, self.y_m), self.radius_m) if self.amplitude != 0 else None

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        """A slope over the sheet, spots all over it, lines and steps across it."""
        slope = ("gradient_x", "gradient_y")
        return Start(cls(), slope, slope), *cls._spots(sensor.extent_m), *cls._lines(sensor.extent_m)

    @classmethod
    def _spots(cls, extent_m: Array) -> Iterator[Start]:
        for x_m, y_m, radius_m in spots_over(extent_m):
            yield Start(cls(x_m=x_m, y_m=y_m, radius_m=radius_m), OF_SPOT, ("amplitude",))

    @classmethod
    def _lines(cls, extent_m: Array) -> Iterator[Start]:
        for angle_rad, offset_m, width_m in lines_over(extent_m):
            line = cls(angle_rad=angle_rad, offset_m=offset_m, width_m=width_m, edge_m=0.3 * width_m)
            yield Start(line, OF_LINE, ("ridge",))
            yield Start(line, OF_STEP, ("step",))

    def beginnings(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        """In which ways a field new to a fit may begin, each with what it frees besides ``free``."""
        return (Start(self, free),)

    def freer(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        """How softly a line begins."""
        if "ridge" in free and "edge_m" not in free:
            return (Start(self, (*free, "edge_m")),)
        return ()
