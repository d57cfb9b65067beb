"""An electrode isn't where the drawing says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import ElectrodeEffect, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Measured, Need, Signal
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor


@dataclass(frozen=True)
class ElectrodeDisplacement(ElectrodeEffect):
    """Pad number ``electrode`` sits (dx, dy) from its nominal place."""

    name: ClassVar[str] = "electrode_displacement"
    source: ClassVar[str] = "Sewing tolerance; shape derivative as in Dardé et al., SIAM J. Imaging Sci. 5 (2012) 649"
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.ELECTRODE,), (Signal.READINGS, Signal.REST), (Need.PADS_INSIDE,), measured=Measured.PAD_SHIFT
    )

    electrode: int = 0
    dx_m: float = parameter("m", -0.01, 0.01, 0.0, 2e-4, "shift along x")
    dy_m: float = parameter("m", -0.01, 0.01, 0.0, 2e-4, "shift along y")

    def geometry(self, sensor: Sensor) -> Sensor:
        if sensor.electrode_edge_m is not None:
            raise ValueError("electrode_displacement moves pads inside the sheet; this sensor's are on its edge")
        center = np.array(sensor.electrode_center_m, dtype=float)
        center[self.electrode] += (self.dx_m, self.dy_m)
        return replace(sensor, electrode_center_m=center)

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        both = ("dx_m", "dy_m")
        return tuple(Start(cls(electrode), both, both) for electrode in range(sensor.electrodes))
