"""How the resting skin's readings go with its contacts and its sheet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.calibration.result import Calibration
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]


def rest_slopes_v(protocol: Protocol, calibration: Calibration, resolution: str) -> Array:
    """(n,L+1) change of the resting skin's whitened coordinates by relative changes of each contact and of the sheet,
    in volt; (n,0) where the recording determines neither."""
    sensor, contact_ohm = calibration.sensor, calibration.contact_resistance_ohm
    if sensor is None or contact_ohm is None:
        return np.zeros((protocol.factor.shape[0], 0))
    model = SheetModel(sensor, resolution)
    solution = model.solve(model.uniform(sensor.sheet_resistance_ohm_sq), contact_ohm)
    by_contact = solution.jacobian_contact_resistance() * contact_ohm
    # All resistances scale together: what the contacts don't do the sheet does (Euler).
    by_sheet = solution.pair_resistance_ohm - by_contact.sum(axis=1)
    return protocol.whitened(np.column_stack([by_contact, by_sheet]).T).T
