"""The part of a scan that some resistor network could give, also for scans that can't tell all pair resistances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.protocol import Protocol, gram_factor, inverse_factor

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ScanSpace:
    """Orthonormal coordinates of the readings that pair resistances can change.

    ``basis`` (K*M,n): readings in volt are ``basis`` times coordinates, plus what no network could give; ``design``
    (n,P): coordinates in volt of pair resistances in ohm. White reading noise stays white. For a scan that tells all
    P = L(L-1)/2 pairs, n = P. Without a weight these are the protocol's own whitened coordinates. With ``weight`` (K,M)
    readings count by their weights, coordinates are those of the readings times the weights' roots.
    """

    basis: Array
    design: Array
    weight: Array | None = None

    @classmethod
    def of(cls, protocol: Protocol, weight: Array | None = None) -> ScanSpace:
        """The protocol's coordinates, or those of its weighted readings."""
        if weight is None:
            return cls(protocol.orthonormal, protocol.factor)
        rows = np.sqrt(weight).reshape(-1, 1) * protocol.design
        factor = gram_factor(rows)
        return cls(rows @ inverse_factor(factor), factor, weight)

    def coordinates(self, voltage_v: Array) -> Array:
        """(..., n) of readings (..., K, M) in volt."""
        weighted = voltage_v if self.weight is None else np.sqrt(self.weight) * voltage_v
        return weighted.reshape(*weighted.shape[:-2], -1) @ self.basis
