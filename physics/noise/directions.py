"""The directions in which a skin's signal stands out of its noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import polar

Array = NDArray[np.float64]


def noise_directions(values: Array, covariance: Array, floor: float = 1e-3) -> tuple[Array, Array]:
    """(inputs,inputs) directions in units of the noise, the strongest of the signal first, and its power in each.

    From (N,inputs) clean values and the noise's covariance. ``floor``: least noise assumed, as a share of the values'
    rms; it keeps a noise-free set usable.
    """
    least = (floor * np.sqrt(np.mean(values**2))) ** 2
    factor = np.linalg.cholesky(covariance + least * np.eye(len(covariance)))
    white = np.linalg.inv(factor).T
    power, direction = np.linalg.eigh(white.T @ (values.T @ values / len(values)) @ white)
    return white @ direction[:, ::-1], power[::-1]


def nearest_directions(directions: Array, others: Array) -> Array:
    """(inputs,D) combinations of white ``directions`` (inputs,inputs), white too, as near as can be to ``others``.

    ``others`` (inputs,D): directions in which another noise was white. The factor of a polar decomposition is the
    nearest of all matrices with orthonormal columns (Higham, SIAM J. Sci. Stat. Comput. 7 (1986) 1160).
    """
    return np.asarray(polar(np.linalg.solve(directions, others))[0])
