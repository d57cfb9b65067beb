"""A scan to the numbers behind it and back, in microseconds: for scans as they come."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ertskin.physics.protocol import Protocol
from ertskin.physics.touch.table import dot

Array = NDArray[np.float64]

SPIKE = 5.0
"""A reading further than this many times its noise from what the others say is left out."""
ROUNDS = 8
MOST_SPIKES = 0.05
"""Share of the readings beyond which it isn't spikes that are wrong."""


class ScanReduction:
    """Whitened coordinates of readings and readings of coordinates (``Protocol.orthonormal``).

    A reading against the sink is made of three pair resistances: by way of those neither takes a whole matrix.
    """

    def __init__(self, protocol: Protocol, noise_v: float) -> None:
        """``noise_v`` of a reading, by which spikes are detected."""
        design, self._inverse = csr_array(protocol.design), np.ascontiguousarray(protocol.inverse_factor)
        self._rows, self._columns = _unsigned(design), _unsigned(csr_array(design.T))
        # Half of a triangle is nought, and fetching the other half is what a product with it costs.
        self._first = (self._inverse != 0.0).argmax(axis=1)
        self._noise_v = noise_v
        self.spare = protocol.count - self._inverse.shape[1]

    def coordinates(self, readings_v: Array) -> Array:
        """(n,) of readings (R,)."""
        return np.asarray(_coordinates(readings_v, *self._columns, self._inverse, self._first))

    def readings(self, coordinates_v: Array) -> Array:
        """(R,) of coordinates (n,)."""
        left, _ = self._left(np.zeros(len(self._rows[0]) - 1), coordinates_v)
        return -left

    def _left(self, change_v: Array, coordinates_v: Array) -> tuple[Array, float]:
        """What coordinates (n,) leave of a change of the readings (R,), and the most of it."""
        left = np.empty(len(change_v))
        return left, float(_less(change_v, *self._rows, self._inverse, self._first, coordinates_v, left))

    def despiked(self, change_v: Array) -> tuple[Array, Array, Array]:
        """Coordinates (n,) of a change of the readings (R,), the change without spikes, and what no resistor network
        could give of it (R,).

        ``ertskin.physics.spikes.despiked`` for one scan whose noise is known: detected by that, not by the scan's own
        scatter, it takes well under a millisecond. The largest spikes go first, or what they pull along would go too.
        """
        coordinates = with_all = self.coordinates(change_v)
        left, worst = self._left(change_v, coordinates)
        gone = np.zeros(0, dtype=np.intp)
        for _ in range(ROUNDS if self.spare > 0 else 0):
            if worst <= SPIKE * self._noise_v:
                break
            away = np.abs(left)
            away[gone] = 0.0
            worst = float(away.max())
            if worst <= SPIKE * self._noise_v:
                break
            more = np.flatnonzero(away > max(SPIKE * self._noise_v, 0.5 * worst))
            if len(gone) + len(more) > MOST_SPIKES * len(change_v):
                break
            gone = np.concatenate([gone, more])
            coordinates = self._without(with_all, change_v[gone], gone)
            left, worst = self._left(change_v, coordinates)
        clean = change_v
        if len(gone):
            clean = change_v.copy()
            clean[gone] -= left[gone]
            left[gone] = 0.0
        return coordinates, clean, left

    def _without(self, with_all: Array, gone_v: Array, gone: NDArray[np.intp]) -> Array:
        """Least-squares coordinates without some of the readings, from those with them (Woodbury)."""
        begin, columns, weights = self._rows
        rows = [slice(begin[k], begin[k + 1]) for k in gone]
        lost = np.array([weights[row] @ self._inverse[columns[row]] for row in rows])
        kept = with_all - gone_v @ lost
        return kept + np.linalg.lstsq(np.eye(len(gone)) - lost @ lost.T, lost @ kept, rcond=1e-9)[0] @ lost


def _unsigned(rows: csr_array) -> tuple[NDArray[np.uint32], NDArray[np.uint32], Array]:
    """Where sparse rows begin, the columns of their numbers, and these; whether an index counts from the end is asked
    of signed ones alone, and takes as long as the product."""
    return rows.indptr.astype(np.uint32), rows.indices.astype(np.uint32), rows.data.astype(float)


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _coordinates(readings, begin, rows, weights, inverse, first):  # type: ignore[no-untyped-def]
    """(n,) readings (R,) times the sparse columns of (R,P) times ``inverse`` (P,n), nought before ``first`` (P,)."""
    found = np.zeros(inverse.shape[1])
    for p in range(len(inverse)):
        value = 0.0
        for m in range(begin[p], begin[p + 1]):
            value += weights[m] * readings[rows[m]]
        row, some = inverse[p, first[p] :], found[first[p] :]
        for j in range(len(row)):
            some[j] += value * row[j]
    return found


@njit(cache=True, nogil=True)
def _less(change, begin, columns, weights, inverse, first, coordinates, left):  # type: ignore[no-untyped-def]
    """Fill ``left`` (R,) with a change (R,) less the readings of coordinates (n,); the largest of it."""
    pairs, worst = np.empty(len(inverse)), 0.0
    for p in range(len(pairs)):
        pairs[p] = dot(inverse[p, first[p] :], coordinates[first[p] :])
    for k in range(len(change)):
        value = change[k]
        for m in range(begin[k], begin[k + 1]):
            value -= weights[m] * pairs[columns[m]]
        left[k] = value
    for k in range(len(left)):
        worst = max(worst, abs(left[k]))
    return worst
