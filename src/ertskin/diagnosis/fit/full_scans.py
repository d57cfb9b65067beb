"""Scans of a skin solved in full, frame by frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.cores import given_cores, in_threads
from ertskin.physics.history import History
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def full_scans(skin: Skin, history: History, force_n: Array, frames: Indices) -> Array:
    """(n,P) whitened scans in volt of some frames (n,), under forces (T,C) in newton; spread over the cores given."""

    def scans(some: Indices) -> Array:
        readings = skin.readings_v(history, force_n, some)
        return np.asarray(readings.reshape(len(some), -1) @ skin.protocol.orthonormal)

    return np.concatenate(in_threads(scans, np.array_split(frames, max(1, min(given_cores(), len(frames))))))
