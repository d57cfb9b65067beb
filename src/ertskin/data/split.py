"""Which trials are trained on and which only watched (paper IV-C: 0.85 to 0.15)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

TRAINING_SHARE = 0.85


def split(trials: int, seed: int, share: float = TRAINING_SHARE) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows for training and for validation, disjoint and together all; the same for the same seed."""
    order = np.random.default_rng(np.random.SeedSequence([seed, 0])).permutation(trials)
    cut = round(share * trials)
    return np.sort(order[:cut]), np.sort(order[cut:])
