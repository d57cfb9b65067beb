"""What calibration finds."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ertskin.errors import UserError
from ertskin.physics.piezo.polynomial import PiezoPolynomial
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Calibration:
    """The simulator's numbers, fitted to one recording; None where the recording can't say.

    ``sensor`` carries the fitted moduli and unloaded sheet resistance. ``law``: sheet resistance against pressure, its
    value at zero stress that of the sheet. ``contact_resistance_ohm`` (L,) with ``contact_resistance_error_ohm`` (L,).
    ``indenter_n_per_m``: stiffness of the indenter's support. ``noise_v``: standard deviation of a reading.
    ``foam_modulus_pa``: of a coupon, cycled. ``notes``: further numbers for people, their units in the names.
    """

    recording: str
    sensor: Sensor | None
    law: PiezoPolynomial | None = None
    contact_resistance_ohm: Array | None = None
    contact_resistance_error_ohm: Array | None = None
    indenter_n_per_m: float | None = None
    noise_v: float | None = None
    foam_modulus_pa: float | None = None
    notes: dict[str, float] = field(default_factory=dict)

    @property
    def known_sensor(self) -> Sensor:
        """The sensor; ``UserError`` where the recording describes none."""
        if self.sensor is None:
            raise UserError(f"{self.recording}: describes no sensor, so no skin can be simulated")
        return self.sensor
