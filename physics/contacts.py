"""Which contacts press, what lies within their reach, and which frames tell of the same places."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def in_contact(contact_m: Array, force_n: Array) -> NDArray[np.bool_]:
    """(T,C) which contacts (T,C,2) press, with forces (T,C) in newton."""
    return np.asarray(np.isfinite(contact_m).all(axis=-1) & (force_n > 0))


def in_air(contact_m: Array, force_n: Array) -> NDArray[np.bool_]:
    """(T,) frames without any contact: memories fade in them."""
    return np.asarray(~in_contact(contact_m, force_n).any(axis=1))


def contact_groups(contact_m: Array, force_n: Array) -> list[Indices]:
    """Frames (in recording order) that share the same contacts (T,C,2); those without any are one group."""
    key = np.where(in_contact(contact_m, force_n)[..., None], contact_m, np.inf).reshape(len(contact_m), -1)
    number = np.unique(key, axis=0, return_inverse=True)[1].ravel()
    return [np.flatnonzero(number == n) for n in range(number.max() + 1)]


def within(position_m: Array, spots: Array, reach_m: float) -> NDArray[np.bool_]:
    """(N,) which positions (N,2) lie less than ``reach_m`` from any of the spots (S,2)."""
    near = np.zeros(len(position_m), dtype=bool)
    for spot in spots:
        near |= ((position_m - spot) ** 2).sum(axis=1) < reach_m**2
    return near


def memory_frames(contact_m: Array, force_n: Array, spots: Array, reach_m: float) -> Indices:
    """Frames in air, and those with a contact so near the spots (S,2) that what it presses overlaps."""
    close = in_air(contact_m, force_n)
    for spot in spots:
        apart = np.nan_to_num(np.hypot(*np.moveaxis(contact_m - spot, -1, 0)), nan=np.inf)
        close |= (apart < 2 * reach_m).any(axis=1)
    return np.flatnonzero(close)


def frames_since(event: NDArray[np.bool_], rows: Indices) -> Indices:
    """(n,) frames from the last ``event`` (T,), that one included, to each of the ``rows``, those too."""
    last = np.maximum.accumulate(np.where(event, np.arange(len(event)), 0))[rows]
    change = np.zeros(len(event) + 1, dtype=np.intp)
    np.add.at(change, last, 1)
    np.add.at(change, rows + 1, -1)
    return np.flatnonzero(np.cumsum(change)[:-1] > 0)
