"""Matrix entries as a linear map of the conductivity at the quadrature points.

An element's matrix is a sum over its quadrature points of reference matrices times three numbers: the conductivity
between the gradients of two barycentric coordinates. The reference matrices stay in cache, so that a scalar and a
tensor cost the same and nothing is stored for each element but its gradients.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.physics.conduction.triangle import Space, quadrature, shape_slopes

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class ElementMatrices:
    """``reference`` (Q,3,K): weight times products of slopes by the second and third barycentric coordinate, for the K
    entries of an element's lower triangle; ``slope`` (E,2,2) and ``area_m2`` (E,) of the elements; ``entry`` (E,K)
    where the entries belong in the matrix."""

    reference: Array
    slope: Array
    area_m2: Array
    entry: Indices

    @classmethod
    def of(cls, space: Space, entry: Indices) -> ElementMatrices:
        """Element matrices of a space."""
        barycentric, weight = quadrature(space.degree)
        slopes = shape_slopes(space.degree, barycentric)
        first, second = slopes[..., 1] - slopes[..., 0], slopes[..., 2] - slopes[..., 0]
        a, b = np.tril_indices(space.element.shape[1])
        mixed = first[:, a] * second[:, b] + second[:, a] * first[:, b]
        products = np.stack([first[:, a] * first[:, b], mixed, second[:, a] * second[:, b]], axis=1)
        reference = np.ascontiguousarray(products * weight[:, None, None])
        return cls(reference, np.ascontiguousarray(space.slope[:, 1:]), space.area_m2, entry)

    def add(self, value: Array, elements: Indices, conductivity_s: Array) -> None:
        """Add to matrix entries in place what conductivities (n,Q) or (n,Q,3) add in some elements (n,)."""
        conductivity = conductivity_s if conductivity_s.ndim == 3 else conductivity_s[..., None]
        _add(value, elements, self.reference, self.slope, self.area_m2, self.entry, np.ascontiguousarray(conductivity))


@njit(cache=True, nogil=True, fastmath={"contract"})
def _add(value, elements, reference, slope, area, entry, conductivity):  # type: ignore[no-untyped-def]
    points, _, kinds = reference.shape
    tensor = conductivity.shape[2] == 3
    total = np.empty(kinds)
    for n in range(len(elements)):
        e = elements[n]
        x1, y1, x2, y2 = slope[e, 0, 0], slope[e, 0, 1], slope[e, 1, 0], slope[e, 1, 1]
        total[:] = 0.0
        for q in range(points):
            xx = area[e] * conductivity[n, q, 0]
            xy = area[e] * conductivity[n, q, 1] if tensor else 0.0
            yy = area[e] * conductivity[n, q, 2] if tensor else xx
            c1 = xx * x1 * x1 + 2.0 * xy * x1 * y1 + yy * y1 * y1
            c2 = xx * x1 * x2 + xy * (x1 * y2 + y1 * x2) + yy * y1 * y2
            c3 = xx * x2 * x2 + 2.0 * xy * x2 * y2 + yy * y2 * y2
            r1, r2, r3 = reference[q, 0], reference[q, 1], reference[q, 2]
            for k in range(kinds):
                total[k] += c1 * r1[k] + c2 * r2[k] + c3 * r3[k]
        for k in range(kinds):
            value[entry[e, k]] += total[k]
