"""What every network answers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Estimate:
    """N frames on a skin of n taxels; forces in newton, places in metres.

    ``force_map_n`` (N,n): force on each taxel, 0 where no contact is declared. ``present`` (N,n): where one is.
    ``contact_m`` (N,C,2), ``contact_force_n`` (N,C): the contacts themselves from a network that places them between
    the taxels, NaN for none; absent from one that doesn't. From one that says how sure it is also ``covariance``
    (N,C,3,3) of x, y and force, ``probability`` (N,C) that a contact is there, and ``misfit`` (N,): what they leave of
    the reading, a mean square in units of the noise.
    """

    force_map_n: Array
    present: NDArray[np.bool_]
    contact_m: Array | None = None
    contact_force_n: Array | None = None
    covariance: Array | None = None
    probability: Array | None = None
    misfit: Array | None = None
