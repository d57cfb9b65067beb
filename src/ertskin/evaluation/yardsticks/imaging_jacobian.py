"""The Jacobian that imaging needs: whitened changes by the conductivity of square pixels over the sheet."""

from __future__ import annotations

import numpy as np

from ertskin.evaluation.yardsticks.yardstick import Array
from ertskin.physics.conduction.sheet import Solution
from ertskin.physics.protocol import Protocol


def imaging_jacobian(solution: Solution, protocol: Protocol, columns: int = 24) -> tuple[Array, Array]:
    """Volt per siemens (P,G) of ``columns`` pixels along the sheet's longer side, and the pixels' centres (G,2).

    ``solution``: the sheet at rest. A pixel is the set of quadrature points nearest to its centre; pixels that hold
    none, outside the outline, are left out.
    """
    point_m = solution.model.quadrature_m
    corner_m = solution.model.mesh.point_m
    low, high = corner_m.min(axis=0), corner_m.max(axis=0)
    cell_m = float((high - low).max()) / columns
    shape = np.maximum(np.ceil((high - low) / cell_m - 1e-9).astype(int), 1)
    index = np.clip(((point_m - low) / cell_m).astype(int), 0, shape - 1)
    number = index[..., 1] * shape[0] + index[..., 0]
    pixels = np.unique(number)
    slopes = [solution.directional((number == pixel).astype(float)) for pixel in pixels]
    centre = np.stack([pixels % shape[0], pixels // shape[0]], axis=1)
    return protocol.whitened(np.stack(slopes)).T, low + (centre + 0.5) * cell_m
