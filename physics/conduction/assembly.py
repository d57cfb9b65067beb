"""Matrix entries as a linear map of the conductivity at the quadrature points: data = M @ sigma."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class ElementMap:
    """The map M, stored by element: ``local`` (E,Q,K) what one siemens at a quadrature point adds to the K entries
    ``entry`` (E,K) of the matrix's ``entries`` entries."""

    local: Array
    entry: Indices
    entries: int

    def apply(self, conductivity_s: Array) -> Array:
        """(entries,) matrix entries of a conductivity (E,Q)."""
        value = np.zeros(self.entries)
        _add(value, np.arange(len(self.entry)), self.local, self.entry, np.ascontiguousarray(conductivity_s))
        return value

    def add(self, value: Array, elements: Indices, change_s: Array) -> None:
        """Add to matrix entries in place what a conductivity change (n,Q) in some elements (n,) adds."""
        _add(value, elements, self.local, self.entry, change_s)


@njit(cache=True, fastmath={"contract"})
def _add(value, elements, local, entry, conductivity):  # type: ignore[no-untyped-def]
    points, kinds = local.shape[1:]
    total = np.empty(kinds)
    for n in range(len(elements)):
        e = elements[n]
        total[:] = 0.0
        for q in range(points):
            s = conductivity[n, q]
            for k in range(kinds):
                total[k] += s * local[e, q, k]
        for k in range(kinds):
            value[entry[e, k]] += total[k]
