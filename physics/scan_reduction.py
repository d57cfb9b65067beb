"""A scan to the numbers behind it and back, in microseconds: for scans as they come."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ertskin.physics.protocol import Protocol

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
        """``noise_v`` of a reading, by which spikes are told."""
        self._design, self._inverse = csr_array(protocol.design), np.ascontiguousarray(protocol.inverse_factor)
        self._back = csr_array(self._design.T)
        self._noise_v = noise_v
        self.spare = protocol.count - self._inverse.shape[1]

    def coordinates(self, readings_v: Array) -> Array:
        """(n,) of readings (R,)."""
        return np.asarray((self._back @ readings_v) @ self._inverse)

    def readings(self, coordinates_v: Array) -> Array:
        """(R,) of coordinates (n,)."""
        return np.asarray(self._design @ (self._inverse @ coordinates_v))

    def despiked(self, change_v: Array) -> tuple[Array, Array, Array]:
        """Coordinates (n,) of a change of the readings (R,), the change without spikes, and what no resistor network
        could give of it (R,).

        ``ertskin.physics.spikes.despiked`` for one scan whose noise is known: told by that, not by the scan's own
        scatter, it takes well under a millisecond. The largest spikes go first, or what they pull along would go too.
        """
        coordinates = with_all = self.coordinates(change_v)
        fit = self.readings(coordinates)
        gone = np.zeros(0, dtype=np.intp)
        for _ in range(ROUNDS if self.spare > 0 else 0):
            away = np.abs(change_v - fit)
            away[gone] = 0.0
            worst = float(away.max())
            if worst <= SPIKE * self._noise_v:
                break
            more = np.flatnonzero(away > max(SPIKE * self._noise_v, 0.5 * worst))
            if len(gone) + len(more) > MOST_SPIKES * len(change_v):
                break
            gone = np.concatenate([gone, more])
            coordinates = self._without(with_all, change_v[gone], gone)
            fit = self.readings(coordinates)
        clean = change_v.copy()
        clean[gone] = fit[gone]
        return coordinates, clean, clean - fit

    def _without(self, with_all: Array, gone_v: Array, gone: NDArray[np.intp]) -> Array:
        """Least-squares coordinates without some of the readings, from those with them (Woodbury)."""
        design = self._design
        rows = [slice(design.indptr[k], design.indptr[k + 1]) for k in gone]
        lost = np.array([design.data[row] @ self._inverse[design.indices[row]] for row in rows])
        kept = with_all - gone_v @ lost
        return kept + np.linalg.lstsq(np.eye(len(gone)) - lost @ lost.T, lost @ kept, rcond=1e-9)[0] @ lost
