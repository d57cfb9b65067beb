"""Folds that hold out a whole band of forces: tuning by what a method does at depths it hasn't seen."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def force_bands(force_map_n: Array, bands: int = 5) -> Iterator[tuple[Indices, Indices]]:
    """Yields (training rows, held-out rows) for ``bands`` contiguous bands of total force, equally filled.

    Shuffled folds would put a neighbour of every held-out press, the same place a tenth of a newton away, among the
    training rows and so favour methods that only remember.
    """
    order = np.argsort(force_map_n.sum(axis=1), kind="stable")
    for held_out in np.array_split(order, bands):
        yield np.setdiff1d(order, held_out), np.sort(held_out)
