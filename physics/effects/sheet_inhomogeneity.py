"""The unloaded sheet resistance varies over the sheet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, SheetEffect
from ertskin.physics.effects.field_over_sheet import FieldOverSheet
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Signal


@dataclass(frozen=True)
class SheetInhomogeneity(FieldOverSheet, SheetEffect):
    """Sheet resistance times exp(g(x)), pressed or not: spot, line, step, slope, smooth field."""

    name: ClassVar[str] = "sheet_inhomogeneity"
    source: ClassVar[str] = "Coating thickness of conductive fabric; log-normal so that it stays positive"
    hypothesis: ClassVar[Hypothesis] = Hypothesis((Axis.PLACE,), (Signal.READINGS,), (), field=True)
    has_a_mean: ClassVar[bool] = False

    def conductivity_s(self, conductivity_s: Array, position_m: Array, extent_m: Array) -> Array:
        factor = np.exp(-self.logarithm(position_m, extent_m))
        tensor = conductivity_s.shape[-1] == 3 and conductivity_s.shape[-2] == len(position_m)
        return conductivity_s * (factor[:, None] if tensor else factor)
