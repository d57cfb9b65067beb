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
    of the pair. Bow, the fault of a fabric whose yarns run in an arc, turns that axis along the sheet: to first order
    ``stretch_diagonal`` grows by ``bow_x`` from the middle to the sheet's end along x, by ``bow_y`` along y.
    """

    name: ClassVar[str] = "sheet_anisotropy"
    source: ClassVar[str] = (
        "Knitted conductive fabrics: ratios of 1.1 to 7 between course and wale; bow and skew: ASTM D3882"
    )
    order: ClassVar[int] = 1
    hypothesis: ClassVar[Hypothesis] = Hypothesis((Axis.PLACE,), (Signal.READINGS,), ())

    stretch_x: float = parameter("1", -2.5, 2.5, 0.0, 0.05, "logarithm of the conductance along x over that along y")
    stretch_diagonal: float = parameter("1", -2.5, 2.5, 0.0, 0.05, "the same for the two diagonals")
    bow_x: float = parameter("1", -2.5, 2.5, 0.0, 0.05, "by how much that grows to the end along x", defining=False)
    bow_y: float = parameter("1", -2.5, 2.5, 0.0, 0.05, "by how much it grows to the end along y", defining=False)

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
        diagonal = np.array([self.stretch_diagonal])
        if self.bow_x or self.bow_y:
            low, high = extent_m
            diagonal = diagonal + (2 * (position_m - low) / (high - low) - 1) @ [self.bow_x, self.bow_y]
        size = np.hypot(self.stretch_x, diagonal)
        even, odd = np.cosh(size / 2), 0.5 * np.sinc(size / 2 * 1j / np.pi).real
        return np.stack([even + odd * self.stretch_x, odd * diagonal, even - odd * self.stretch_x], axis=1)

    def conductivity_s(self, conductivity_s: Array, position_m: Array, extent_m: Array) -> Array:
        if conductivity_s.shape[-1] == 3 and conductivity_s.shape[-2] == len(position_m):
            raise ValueError("sheet_anisotropy comes once, before any other tensor")
        return conductivity_s[..., None] * self.tensor(position_m, extent_m)

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        both = ("stretch_x", "stretch_diagonal")
        bowed = (*both, "bow_x", "bow_y")
        return Start(cls(), both, both), Start(cls(), bowed, bowed)
