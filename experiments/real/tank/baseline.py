"""Plain one-step Gauss-Newton: one linear step from the empty tank with a smoothness prior."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.tank.inclusions import RIDGE, Imaging, InclusionMap, bend, reading_variance
from ertskin.physics.calibration.scan_space import ScanSpace

Array = NDArray[np.float64]

WEIGHTS = 10.0 ** np.arange(7, -3.1, -0.5)


def one_step(imaging: Imaging, voltage_v: Array, variance_v2: Array | None = None) -> InclusionMap:
    """Map of a scan (K,M); the weight of the smoothness where the L-curve bends."""
    change = voltage_v - imaging.empty_v
    variance = reading_variance(imaging.protocol, change) if variance_v2 is None else variance_v2
    space = ScanSpace.of(imaging.protocol, 1.0 / variance)
    measured = space.coordinates(change)
    jacobian = imaging.jacobian(imaging.empty, space.design @ imaging.pairs_of_transfer)
    rough = (imaging.slopes.T @ imaging.slopes).toarray() + RIDGE * np.eye(jacobian.shape[1])
    root = np.linalg.cholesky(rough)
    left, size, right = np.linalg.svd(np.linalg.solve(root, jacobian.T).T, full_matrices=False)
    along = left.T @ measured
    outside = float(measured @ measured - along @ along)
    maps = []
    for weight in WEIGHTS:
        kept = size**2 / (size**2 + weight)
        misfit = float(outside + (((1 - kept) * along) ** 2).sum())
        log_ratio = np.linalg.solve(root.T, right.T @ (kept / size * along))
        variation = float(log_ratio @ rough @ log_ratio)
        maps.append(InclusionMap(imaging.hats, imaging.inside, log_ratio, float(weight), misfit, variation))
    return bend(maps)
