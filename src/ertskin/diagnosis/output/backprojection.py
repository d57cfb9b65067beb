"""What change of the sheet the misfit looks like, seen from rest: where to look, not what it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.linear.linear_skin import LinearSkin

Array = NDArray[np.float64]

PRIOR = 0.02
"""Standard deviation, beforehand, of the relative change of conductance at a node of the grid."""


def backprojected(linear: LinearSkin, residual: Array, noise_v: float) -> tuple[Array, Array]:
    """Nodes (H,2) in metre, relative change of conductance (H,) most likely behind the mean residual of frames (n,P).

    ``residual`` in units of the noise. One linear step about the resting sheet with white noise and a white prior:
    Gauss-Newton imaging (Adler and Guardo, IEEE Trans. Med. Imaging 15 (1996) 170).
    """
    derivative = linear.sheet.derivatives[0][:, 0].astype(float) / noise_v
    mean, frames = residual.mean(axis=0), len(residual)
    hessian = frames * derivative.T @ derivative + np.eye(derivative.shape[1]) / PRIOR**2
    return linear.sheet.hats.node_m, np.asarray(np.linalg.solve(hessian, frames * derivative.T @ mean))
