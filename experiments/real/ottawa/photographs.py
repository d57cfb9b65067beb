"""What photographed electrodes make one expect of the readings: their images on the disk."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from simulated import beyond_disk_maps, disk_angles, even_angles

Array = NDArray[np.float64]

ORDER = 3
"""Of the outline drawn through sixteen electrodes: radius as a Fourier series in the angle."""
PULL = 0.05
ACCURACY = 0.03
"""Of a photographed place, over the radius, as its note says."""
DRAWS = 200


def expected_shift(center_m: Array) -> Array:
    """(16,) angles by which electrodes at (16,2), on the outline through them, lie beside even ones on the disk."""
    radius, angle = np.linalg.norm(center_m, axis=1), np.mod(np.arctan2(center_m[:, 1], center_m[:, 0]), 2 * np.pi)
    log = np.log(radius)
    ridge = PULL * np.eye(2 * ORDER + 1)
    weight = np.linalg.lstsq(
        np.vstack([_waves(angle), ridge]), np.append(log - log.mean(), np.zeros(2 * ORDER + 1)), rcond=None
    )[0]
    place = disk_angles(lambda theta: np.exp(log.mean() + _waves(theta) @ weight), angle)
    return beyond_disk_maps(place - even_angles())


def angles_alone(center_m: Array) -> Array:
    """(16,) the same for who takes the outline to be round."""
    return beyond_disk_maps(np.arctan2(center_m[:, 1], center_m[:, 0]) - even_angles())


def blur(center_m: Array, radius_m: float, seed: int = 0) -> float:
    """Rms by which ``expected_shift`` moves where every photographed place is off by ``ACCURACY``, along each axis."""
    draw = np.random.default_rng(seed)
    unmoved = expected_shift(center_m)
    off = [
        expected_shift(center_m + ACCURACY / np.sqrt(2) * radius_m * draw.standard_normal(center_m.shape)) - unmoved
        for _ in range(DRAWS)
    ]
    return float(np.sqrt(np.mean(np.square(off))))


def _waves(angle: Array) -> Array:
    order = np.arange(1, ORDER + 1)
    return np.concatenate(
        [np.ones((*np.shape(angle), 1)), np.cos(angle[..., None] * order), np.sin(angle[..., None] * order)], axis=-1
    )
