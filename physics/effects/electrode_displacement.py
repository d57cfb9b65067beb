"""An electrode isn't where the drawing says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from physics.effects.effect import ElectrodeEffect, parameter
from physics.sensor import Sensor


@dataclass(frozen=True)
class ElectrodeDisplacement(ElectrodeEffect):
    """Pad number ``electrode`` sits (dx, dy) from its nominal place."""

    name: ClassVar[str] = "electrode_displacement"
    source: ClassVar[str] = "Sewing tolerance; shape derivative as in Dardé et al., SIAM J. Imaging Sci. 5 (2012) 649"

    electrode: int = 0
    dx_m: float = parameter("m", -0.01, 0.01, 0.0, 2e-4, "shift along x")
    dy_m: float = parameter("m", -0.01, 0.01, 0.0, 2e-4, "shift along y")

    def geometry(self, sensor: Sensor) -> Sensor:
        if sensor.electrode_edge_m is not None:
            raise ValueError("electrode_displacement moves pads inside the sheet; this sensor's are on its edge")
        center = np.array(sensor.electrode_center_m, dtype=float)
        center[self.electrode] += (self.dx_m, self.dy_m)
        return replace(sensor, electrode_center_m=center)
