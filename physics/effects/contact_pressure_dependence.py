"""An electrode's contact resistance falls where it is pressed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from physics.effects.effect import Array, ElectrodeEffect, parameter

LEAST_OHM = 1e-2
"""What no pressure brings a contact below."""


@dataclass(frozen=True)
class ContactPressureDependence(ElectrodeEffect):
    """Contact resistance over (1 + q/q_half)^exponent, q the mean interface pressure on the electrode.

    ``sensitivity_per_pa`` = 1/q_half: neutral at 0.
    """

    name: ClassVar[str] = "contact_pressure_dependence"
    source: ClassVar[str] = "Holm, Electric Contacts (1967): constriction resistance as a power of the load"

    sensitivity_per_pa: float = parameter("1/Pa", 0.0, 0.1, 0.0, 2e-5, "inverse of the pressure that starts to matter")
    exponent: float = parameter("1", 0.1, 30.0, 1.0, 0.2, "power of the load", defining=False)

    def contact_resistance_ohm(self, resistance_ohm: Array, pad_pressure_pa: Array, time_s: Array) -> Array:
        loaded = 1 + self.sensitivity_per_pa * np.maximum(pad_pressure_pa, 0.0)
        return np.asarray(np.maximum(resistance_ohm / loaded**self.exponent, np.minimum(resistance_ohm, LEAST_OHM)))
