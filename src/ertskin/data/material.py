"""All that training needs of a skin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.data.trials import TrialSet
from ertskin.physics.noise.model import Noise
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Material:
    """``trials`` to learn touches from, ``denoiser`` trials where there are any, and the ``noise`` to learn them with.

    ``taxel_m`` (n,2): the sensing points of the trials' force maps. ``checksum`` names the data for good.
    """

    protocol: Protocol
    taxel_m: Array
    trials: TrialSet
    noise: Noise
    checksum: str
    denoiser: TrialSet | None = None
