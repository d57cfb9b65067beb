"""What two contacts do together, as a polynomial of both forces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Solve = Callable[[Array, Array], Array]

FORCES = np.array([0.2, 0.5, 1.0])
"""Forces solved for each contact, as shares of the largest."""
POWERS = np.array([1, 2, 3])


class PairTable:
    """``together(contacts, forces)`` at every pair of ``places_m`` (C,2) from ``least_m`` on and less than ``most_m``
    apart, interpolated in force.

    It vanishes where either force does, so a product of two cubics through zero carries it. ``together`` takes contacts
    (N,2,2) and forces (N,2), and is asked for nine pairs of forces at each pair of places.
    """

    def __init__(
        self, together: Solve, places_m: Array, max_force_n: float, least_m: float = 0.0, most_m: float = np.inf
    ) -> None:
        apart = np.hypot(*(places_m[:, None] - places_m).transpose(2, 0, 1))
        pairs = np.argwhere(np.triu((apart >= least_m) & (apart < most_m), 1))
        self.max_force_n = max_force_n
        self._number = np.full(apart.shape, -1)
        self._number[tuple(pairs.T)] = np.arange(len(pairs))
        self._coefficient = np.zeros((0, len(POWERS), len(POWERS), 1))
        if len(pairs):
            both = np.stack(np.meshgrid(FORCES, FORCES, indexing="ij"), axis=2).reshape(-1, 2)
            found = together(
                places_m[np.repeat(pairs, len(both), axis=0)], max_force_n * np.tile(both, (len(pairs), 1))
            )
            inverse = np.linalg.inv(FORCES[:, None] ** POWERS)
            table = found.reshape(len(pairs), len(FORCES), len(FORCES), -1)
            self._coefficient = np.einsum("ak,bl,nklp->nabp", inverse, inverse, table, optimize=True)

    def of(self, place: Indices, force_n: Array) -> Array:
        """(N,numbers) sum over the table's pairs among contacts at places numbered (N,P), -1 for an absent one.

        Each row is the same whatever other rows there are.
        """
        total = np.zeros((len(place), self._coefficient.shape[-1]))
        for j in range(place.shape[1]):
            for i in range(place.shape[1]):
                number = np.where((place[:, i] >= 0) & (place[:, j] >= 0), self._number[place[:, i], place[:, j]], -1)
                for each in np.unique(number[number >= 0]):
                    rows = np.flatnonzero(number == each)
                    first, second = ((force_n[rows, k, None] / self.max_force_n) ** POWERS for k in (i, j))
                    for a, b in np.ndindex(len(POWERS), len(POWERS)):
                        total[rows] += (first[:, a] * second[:, b])[:, None] * self._coefficient[each, a, b]
        return total
