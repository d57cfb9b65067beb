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


@dataclass(frozen=True)
class SheetAnisotropy(SheetEffect):
    """Conductance exp(+m/2) along an axis and exp(-m/2) across it, m = |(``stretch_x``, ``stretch_diagonal``)|.

    ``stretch_x`` > 0 conducts better along x, ``stretch_diagonal`` > 0 along the diagonal x = y: two numbers that
    change smoothly through isotropy, where an angle would not. Ratio of conductances exp(m), axis at half the angle
    of the pair.
    """

    name: ClassVar[str] = "sheet_anisotropy"
    source: ClassVar[str] = "Knitted conductive fabrics: ratios of 1.1 to 7 between course and wale"
    order: ClassVar[int] = 1
    hypothesis: ClassVar[Hypothesis] = Hypothesis((Axis.PLACE,), (Signal.READINGS,), ())

    stretch_x: float = parameter("1", -2.5, 2.5, 0.0, 0.05, "logarithm of the conductance along x over that along y")
    stretch_diagonal: float = parameter("1", -2.5, 2.5, 0.0, 0.05, "the same for the two diagonals")

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

    def tensor(self) -> Array:
        """(3,) [xx, xy, yy] of the conductance tensor with unit determinant."""
        size = float(np.hypot(self.stretch_x, self.stretch_diagonal))
        even = np.cosh(size / 2)
        odd = np.sinh(size / 2) / size if size > 0 else 0.5
        return np.array([even + odd * self.stretch_x, odd * self.stretch_diagonal, even - odd * self.stretch_x])

    def conductivity_s(self, conductivity_s: Array, position_m: Array, extent_m: Array) -> Array:
        if conductivity_s.shape[-1] == 3 and conductivity_s.shape[-2] == len(position_m):
            raise ValueError("sheet_anisotropy comes once, before any other tensor")
        return conductivity_s[..., None] * self.tensor()

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        both = ("stretch_x", "stretch_diagonal")
        return (Start(cls(), both, both),)
