"""What the untouched skin reads at the time of each frame: the zero that changes are counted from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.errors import UserError
from ertskin.physics.history import History, Phase

Array = NDArray[np.float64]


def rest_weights(history: History, coordinates_v: Array) -> Array:
    """(T,R) weights of the R rest frames in the zero of each of T frames, rows summing to one.

    The zero is the mean of the rest frames nearest in time. How many is chosen by how well the others predict each
    rest frame in ``coordinates_v`` (T,P): one where the baseline wanders, all where it only carries noise. Raises
    ``UserError`` where there is no rest frame.
    """
    rest = np.flatnonzero(history.phase == Phase.REST)
    if not len(rest):
        raise UserError("the recording has no rest frame (phase 0) to count changes from")
    window = _window(history.time_s[rest], coordinates_v[rest])
    return _nearest(history.time_s, history.time_s[rest], window)


def others_weights(rest_s: Array, rest_v: Array) -> Array:
    """(R,R) weights of the other rest frames in the zero of each of the (R,P) taken at ``rest_s`` (R,), chosen as in
    ``rest_weights``; of a single one all nought."""
    if len(rest_s) < 2:
        return np.zeros((len(rest_s), len(rest_s)))
    return _nearest(rest_s, rest_s, min(_window(rest_s, rest_v), len(rest_s) - 1), itself=False)


def _window(time_s: Array, rest_v: Array) -> int:
    """How many neighbours predict a rest frame best, from 1, 2, 4, … to all others."""
    others = len(rest_v) - 1
    if others < 2:
        return len(rest_v)
    choices = sorted({min(2**k, others) for k in range(others.bit_length() + 1)})
    errors = [((rest_v - _nearest(time_s, time_s, n, itself=False) @ rest_v) ** 2).sum() for n in choices]
    best = choices[int(np.argmin(errors))]
    return len(rest_v) if best == others else best


def _nearest(time_s: Array, rest_s: Array, count: int, *, itself: bool = True) -> Array:
    """(T,R) equal weights on the ``count`` rest frames nearest to each time; ``itself=False`` leaves out its own."""
    away = np.abs(time_s[:, None] - rest_s)
    if not itself:
        np.fill_diagonal(away, np.inf)
    chosen = np.argsort(away, axis=1, kind="stable")[:, :count]
    weights = np.zeros(away.shape)
    np.put_along_axis(weights, chosen, 1.0 / count, axis=1)
    return weights
