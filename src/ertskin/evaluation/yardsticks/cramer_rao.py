"""The least standard deviation any unbiased estimate of the forces can have (Cramér 1946, Rao 1945)."""

from __future__ import annotations

import numpy as np

from ertskin.evaluation.yardsticks.forward import Indices, Response
from ertskin.evaluation.yardsticks.yardstick import Array


def force_bound_n(
    response: Response, taxel: Indices, force_n: Array, covariance_v2: Array | float, step_n: float = 0.02
) -> Array:
    """(N,C) newton: square roots of the diagonal of (J' S^-1 J)^-1, J = d change / d force, taxels known.

    ``taxel`` (N,C) numbers of the taxels pressed with ``force_n`` (N,C); ``covariance_v2`` (P,P) or scalar noise of the
    whitened changes. J by central differences of ``step_n``.
    """
    count = force_n.shape[1]
    columns = []
    for contact in range(count):
        shift_n = step_n * np.eye(count)[contact]
        ahead_v, behind_v = (response.change_v(taxel, force_n + sign * shift_n) for sign in (1.0, -1.0))
        columns.append((ahead_v - behind_v) / (2.0 * step_n))
    slope = np.stack(columns, axis=-1)
    width = slope.shape[1]
    covariance = np.asarray(covariance_v2) if np.ndim(covariance_v2) else np.eye(width) * float(covariance_v2)
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), slope)
    information = np.einsum("npc,npd->ncd", whitened, whitened)
    return np.sqrt(np.diagonal(np.linalg.inv(information), axis1=1, axis2=2))
