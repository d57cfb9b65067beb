"""The stage's frame and the sensor's differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, PlacementEffect, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Measured, Need, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

RIGID = ("dx_m", "dy_m", "rotation_rad")


@dataclass(frozen=True)
class IndenterOffset(PlacementEffect):
    """The indenter lands shifted by (dx, dy) and turned by ``rotation_rad`` about the sheet's middle.

    A stage's axes need not be square nor its steps as long as commanded: x is stretched by ``stretch_x``, y by
    ``stretch_y``, and x goes with y by ``skew_rad``, about the sheet's middle and before the turn.
    """

    name: ClassVar[str] = "indenter_offset"
    source: ClassVar[str] = (
        "Rigid motion of one frame against the other; squareness and lead errors of an XY stage, Schwenke and others, "
        "CIRP Annals 57 (2008) 660"
    )
    form_error: ClassVar[float] = 0.06
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.PLACE,), (Signal.READINGS,), (Need.PRESSES,), measured=Measured.LANDING
    )

    dx_m: float = parameter("m", -0.01, 0.01, 0.0, 2e-4, "shift along x")
    dy_m: float = parameter("m", -0.01, 0.01, 0.0, 2e-4, "shift along y")
    rotation_rad: float = parameter("rad", -0.2, 0.2, 0.0, 2e-3, "turn about the sheet's middle")
    stretch_x: float = parameter("1", -0.1, 0.1, 0.0, 5e-3, "lead error of the x axis")
    stretch_y: float = parameter("1", -0.1, 0.1, 0.0, 5e-3, "lead error of the y axis")
    skew_rad: float = parameter("rad", -0.2, 0.2, 0.0, 2e-3, "how far the y axis leans towards x")

    def contact_m(self, commanded_m: Array, center_m: Array) -> Array:
        c, s = np.cos(self.rotation_rad), np.sin(self.rotation_rad)
        axes = np.array([[1 + self.stretch_x, 0.0], [self.skew_rad, 1 + self.stretch_y]])
        turned = (commanded_m - center_m) @ axes @ np.array([[c, s], [-s, c]])
        return turned + center_m + np.array([self.dx_m, self.dy_m])

    def quantities(self, standard: Standard) -> dict[str, float]:
        """How far presses land from where they were commanded, mean over the places pressed."""
        if not len(standard.pressed_m):
            return {}
        shift_m = self.contact_m(standard.pressed_m, standard.extent_m.mean(axis=0)) - standard.pressed_m
        dx_m, dy_m = shift_m.mean(axis=0)
        return {"dx_m": float(dx_m), "dy_m": float(dy_m)}

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        return (Start(cls(), RIGID, RIGID),)

    def freer(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        """A stage whose axes are neither square nor to scale."""
        every = tuple(self.parameters())
        return () if set(every) <= set(free) else (Start(self, every),)
