"""Where a map is higher than all round."""

from __future__ import annotations

from functools import reduce

import numpy as np
from numpy.typing import NDArray

from ertskin.evaluation.yardsticks.yardstick import Array


def highest_near(values: Array, near: NDArray[np.bool_]) -> Array:
    """(N,n) for each of n points the highest of its own value in ``values`` (N,n) and of those ``near`` it (n,n)."""
    most = int(near.sum(axis=1).max(initial=0))
    order = np.argsort(~near, axis=1, kind="stable")[:, :most]
    own = np.arange(len(near))
    padded = np.where(np.take_along_axis(near, order, axis=1), order, own[:, None])
    return reduce(np.maximum, (values[:, column] for column in padded.T), values)
