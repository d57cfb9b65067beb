"""The fabric conducts better along one direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, SheetEffect, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

TURNS_RAD = -0.5, 0.5
"""Turns of the axis at which fits begin."""


@dataclass(frozen=True)
class SheetAnisotropy(SheetEffect):
    """Conductance exp(+m/2) along an axis and exp(-m/2) across it, m = |(``stretch_x``, ``stretch_diagonal``)|.

    ``stretch_x`` > 0 conducts better along x, ``stretch_diagonal`` > 0 along the diagonal x = y: two numbers that
    change smoothly through isotropy, where an angle would not. Ratio of conductances exp(m), axis at half the angle
    of the pair. In a bowed fabric, whose yarns run in an arc, that axis turns along the sheet: by ``turn_x_rad`` from
    the middle to the sheet's end along x, by ``turn_y_rad`` along y.
    """

    name: ClassVar[str] = "sheet_anisotropy"
    source: ClassVar[str] = (
        "Knitted conductive fabrics: ratios of 1.1 to 7 between course and wale; bow and skew: ASTM D3882"
    )
    order: ClassVar[int] = 1
    hypothesis: ClassVar[Hypothesis] = Hypothesis((Axis.PLACE,), (Signal.READINGS,), ())

    stretch_x: float = parameter("1", -2.5, 2.5, 0.0, 0.05, "logarithm of the conductance along x over that along y")
    stretch_diagonal: float = parameter("1", -2.5, 2.5, 0.0, 0.05, "the same for the two diagonals")
    turn_x_rad: float = parameter("rad", -1.5, 1.5, 0.0, 0.3, "turn of the axis to the end along x", defining=False)
    turn_y_rad: float = parameter("rad", -1.5, 1.5, 0.0, 0.3, "turn of the axis to the end along y", defining=False)

    @property
    def ratio(self) -> float:
        """Conductance along the better axis over that across it."""
        return float(np.exp(np.hypot(self.stretch_x, self.stretch_diagonal)))

    @property
    def angle_rad(self) -> float:
        """Direction of the better axis against x."""
        return float(0.5 * np.arctan2(self.stretch_diagonal, self.stretch_x))

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Conductance along the better axis over that across it."""
        return {"conductance_ratio": self.ratio}

    def tensor(self, position_m: Array, extent_m: Array) -> Array:
        """(N,3) [xx, xy, yy] of the conductance tensor with unit determinant at points (N,2) of a sheet (2,2); (1,3)
        where it is the same everywhere."""
        size = float(np.hypot(self.stretch_x, self.stretch_diagonal))
        even = np.cosh(size / 2)
        odd = np.sinh(size / 2) / size if size > 0 else 0.5
        turn = np.zeros(1)
        if self.turn_x_rad or self.turn_y_rad:
            low, high = extent_m
            turn = 2 * (2 * (position_m - low) / (high - low) - 1) @ [self.turn_x_rad, self.turn_y_rad]
        x = np.cos(turn) * self.stretch_x - np.sin(turn) * self.stretch_diagonal
        diagonal = np.sin(turn) * self.stretch_x + np.cos(turn) * self.stretch_diagonal
        return np.stack([even + odd * x, odd * diagonal, even - odd * x], axis=1)

    def conductivity_s(self, conductivity_s: Array, position_m: Array, extent_m: Array) -> Array:
        if conductivity_s.shape[-1] == 3 and conductivity_s.shape[-2] == len(position_m):
            raise ValueError("sheet_anisotropy comes once, before any other tensor")
        return conductivity_s[..., None] * self.tensor(position_m, extent_m)

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        """The same axis everywhere, and one that turns along the sheet."""
        both = ("stretch_x", "stretch_diagonal")
        turns = [(x, 0.0) for x in TURNS_RAD] + [(0.0, y) for y in TURNS_RAD]
        turned = tuple(Start(cls(0.0, 0.0, *turn), (*both, "turn_x_rad", "turn_y_rad"), both) for turn in turns)
        return Start(cls(), both, both), *turned
