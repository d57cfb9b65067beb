"""Stiffness of the 8-node brick with mean dilatation (B-bar), for rectangular bricks.

The trilinear isoparametric brick of Liu & Quek (paper II-B), integrated with 2x2x2 Gauss points, locks where a material
can hardly change its volume (the glue, Poisson's ratio 0.495). Here the dilatation is replaced by its mean over the
brick (Hughes, Int. J. Numer. Methods Eng. 15 (1980) 1413) and everything else stays as it was.

A rectangular brick's stiffness depends on its sides only through V/(h_a h_b): it is a sum of a few constant matrices.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
"""(8,3) the nodes of a brick in its grid: x slowest, z fastest."""


def _unit_gradients() -> Array:
    """(8 Gauss points, 8 nodes, 3) gradients of the trilinear shape functions of the unit cube."""
    side = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3)
    points = np.array([[a, b, c] for a in side for b in side for c in side])
    ramp = np.where(CORNERS == 1, points[:, None, :], 1 - points[:, None, :])
    sign = 2.0 * CORNERS - 1
    x, y, z = np.moveaxis(ramp, -1, 0)
    return sign * np.stack([y * z, x * z, x * y], axis=-1)


def brick_stiffness(size_m: Array, youngs_modulus_pa: Array, poissons_ratio: Array) -> Array:
    """(n,24,24) stiffness in N/m of bricks with sides (n,3) of isotropic materials (n,); node by node, x, y, z."""
    shear = youngs_modulus_pa / (2 * (1 + poissons_ratio))
    bulk = youngs_modulus_pa / (3 * (1 - 2 * poissons_ratio))
    gradients = _unit_gradients()
    full = np.einsum("gia,gjb->abij", gradients, gradients) / len(gradients)
    mean = gradients.mean(axis=0)
    volume = size_m.prod(axis=1)
    stiffness = np.zeros((len(size_m), 8, 3, 8, 3))
    for a in range(3):
        for b in range(3):
            scale = (volume / (size_m[:, a] * size_m[:, b]))[:, None, None]
            if a == b:
                for component in range(3):
                    stiffness[:, :, component, :, component] += shear[:, None, None] * scale * full[a, a]
            stiffness[:, :, a, :, b] += scale * (
                shear[:, None, None] * (full[b, a] - 2 / 3 * full[a, b])
                + bulk[:, None, None] * np.multiply.outer(mean[:, a], mean[:, b])
            )
    return stiffness.reshape(-1, 24, 24)
