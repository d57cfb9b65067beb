"""How scans hang on a contact's resistance: straight as it lies in series, not at all straight as its pad shunts.

An electrode's own voltage while it is driven holds its contact in series. All readings hold what its pad carries past
the sheet under it, and the less the more its contact resists: nearly as what contact and pad conduct in series, which
is straight in neither the resistance nor its logarithm. Where driven electrodes aren't read that is all they hold.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.protocol import Protocol, pair_resistances

Array = NDArray[np.float64]

INSIDE = 1 / (8 * np.pi)
"""Over the sheet's resistance, the contact's at which a pad inside the sheet shunts half of what it would by a perfect
one: a disc of radius a in a field E takes a^2 E^2 / (4 R) where its contact resists much, and 2 pi a^2 E^2 over the
sheet's resistance where it doesn't."""
ON_EDGE = 2 / (3 * np.pi)
"""The same of one on the sheet's edge: w^2 E^2 / (12 R) for a length w, and pi w^2 E^2 / 8 over the sheet's
resistance."""


def pad_resistances(model: SheetModel, sheet_ohm_sq: float) -> Array:
    """(L,) resistance in ohm that each pad has in itself against the sheet, in series with its contact's.

    Of a sheet as it is unpressed and on the whole; what presses and fields make of it under a pad counts to first order
    alone.
    """
    return sheet_ohm_sq * np.array([ON_EDGE if len(side) else INSIDE for side in model.mesh.edge])


def by_series(protocol: Protocol) -> Array:
    """(P,L) derivative of whitened scans, in volt per ohm, by what lies in series with each electrode alone."""
    alone = np.eye(protocol.electrodes)
    return protocol.whitened(pair_resistances(alone[:, :, None] * alone[:, None, :])).T


def conducting(contact_ohm: Array, pad_ohm: Array) -> Array:
    """(...,L) siemens: what contacts (...,L) and the pads' own resistances (L,) conduct."""
    return np.asarray(1.0 / (contact_ohm + pad_ohm))


def uneven(contact_ohm: Array, pad_ohm: Array) -> Array:
    """(...,L) ohm by which an uneven contact shows that it leans: its own where it resists little, for the current that
    flows anyway loses less there, and its pad's where it resists much, for as much less is shunted as it resists more.
    """
    return np.asarray(contact_ohm * pad_ohm * conducting(contact_ohm, pad_ohm))
