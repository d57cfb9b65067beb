"""The converter clips."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import AcquisitionEffect, Array
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Measured, Signal
from ertskin.physics.protocol import Protocol


@dataclass(frozen=True)
class AdcSaturation(AcquisitionEffect):
    """Readings beyond ``limit_v`` read ``limit_v``; below ``lowest_v``, ``lowest_v``."""

    name: ClassVar[str] = "adc_saturation"
    source: ClassVar[str] = "Full scale of a converter or the rail of the amplifier before it"
    order: ClassVar[int] = 2
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.ELECTRODE,), (Signal.NONRECIPROCAL,), (), measured=Measured.READING_LIMIT
    )

    limit_v: float = float("inf")
    lowest_v: float = float("-inf")

    def distorted_v(self, voltage_v: Array, protocol: Protocol) -> Array:
        return np.clip(voltage_v, self.lowest_v, self.limit_v)
