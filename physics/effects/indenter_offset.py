"""The stage's frame and the sensor's differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, PlacementEffect, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Measured, Need, Signal
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor


@dataclass(frozen=True)
class IndenterOffset(PlacementEffect):
    """The indenter lands shifted by (dx, dy) and turned by ``rotation_rad`` about the sheet's middle."""

    name: ClassVar[str] = "indenter_offset"
    source: ClassVar[str] = "Rigid motion of one frame against the other"
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.PLACE,), (Signal.READINGS,), (Need.PRESSES,), measured=Measured.LANDING
    )

    dx_m: float = parameter("m", -0.01, 0.01, 0.0, 2e-4, "shift along x")
    dy_m: float = parameter("m", -0.01, 0.01, 0.0, 2e-4, "shift along y")
    rotation_rad: float = parameter("rad", -0.2, 0.2, 0.0, 2e-3, "turn about the sheet's middle")

    def contact_m(self, commanded_m: Array, center_m: Array) -> Array:
        c, s = np.cos(self.rotation_rad), np.sin(self.rotation_rad)
        turned = (commanded_m - center_m) @ np.array([[c, s], [-s, c]])
        return turned + center_m + np.array([self.dx_m, self.dy_m])

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        every = tuple(cls.parameters())
        return (Start(cls(), every, every),)
