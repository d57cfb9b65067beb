"""Least distance programming: the nearest point that fulfils linear inequalities."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]

TINY = 1e-300
NEVER = 1e-12
"""What is left of the dual problem, below which no point fulfils the inequalities."""


def nearest_point(point: Array, rows: Array, least: Array) -> Array | None:
    """The y (n,) nearest to a point (n,) with ``rows`` (k,n) times y at least ``least`` (k,); None where none is found.

    By its dual, a non-negative least-squares problem (Lawson & Hanson, Solving Least Squares Problems (1974), ch. 23).
    """
    short = least - rows @ point
    unit = max(float(np.abs(short).max()), TINY)
    dual = np.vstack([rows.T, short / unit])
    goal = np.zeros(len(dual))
    goal[-1] = 1.0
    try:
        rest = dual @ nnls(dual, goal)[0] - goal
    except RuntimeError:  # it hasn't converged
        return None
    return np.asarray(point - unit * rest[:-1] / rest[-1]) if rest[-1] < -NEVER else None
