"""The strongest kernel ridge we could tune: what the network has to beat."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist
from sklearn.covariance import ledoit_wolf
from touches import SkinTouches, errors_mm

Array = NDArray[np.float64]
SCALES = (100.0, 300.0, 1000.0, 3000.0, np.inf)
METRICS = ("standardised", "noise-whitened")
KERNELS = ("gaussian", "laplacian", "matern-3/2")
WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0)
PENALTIES = (1e-4, 1e-3, 1e-2, 1e-1, 1.0)
SMOOTH_MM, SIGNAL_RANK = 12.0, 20


@dataclass(frozen=True)
class Setting:
    """``scale`` s of the compression asinh(x/s), infinite for none; ``metric`` of the inputs; ``width`` of the kernel
    in median distances; ``penalty`` on the diagonal."""

    scale: float
    metric: str
    kernel: str
    width: float
    penalty: float


def compressed(response: Array, scale: float) -> Array:
    """asinh(x/s): linear for weak responses, logarithmic for strong ones."""
    return response if np.isinf(scale) else np.arcsinh(response / scale)


def noise_directions(inputs: Array, place_mm: Array) -> Array:
    """(192,20) directions in which the place shows most above what changes at one place.

    A smooth field over the sheet is fitted to every channel, each touch predicted from the others; what it leaves is
    noise, its covariance shrunk as by Ledoit and Wolf.
    """
    kernel = np.exp(-0.5 * cdist(place_mm, place_mm, "sqeuclidean") / SMOOTH_MM**2) + 0.1 * np.eye(len(inputs))
    inverse = np.linalg.inv(kernel)
    left_over = (inverse @ inputs) / np.diag(inverse)[:, None]
    whitening = np.linalg.cholesky(np.linalg.inv(ledoit_wolf(left_over)[0]))
    _, vectors = np.linalg.eigh(np.cov(((inputs - left_over) @ whitening).T))
    return whitening @ vectors[:, ::-1][:, :SIGNAL_RANK]


def _features(train: Array, test: Array, place_mm: Array, scale: float, metric: str) -> tuple[Array, Array]:
    train, test = compressed(train, scale), compressed(test, scale)
    mean, spread = train.mean(axis=0), train.std(axis=0)
    train, test = (train - mean) / spread, (test - mean) / spread
    if metric == "noise-whitened":
        directions = noise_directions(train, place_mm)
        train, test = train @ directions, test @ directions
    return train, test


def _kernel(distance: Array, kind: str) -> Array:
    if kind == "gaussian":
        return np.exp(-0.5 * distance**2)
    if kind == "laplacian":
        return np.exp(-distance)
    return (1 + np.sqrt(3) * distance) * np.exp(-np.sqrt(3) * distance)


def tuned(touches: SkinTouches) -> tuple[Setting, float, int]:
    """The best of the whole grid by mean error over the tuning folds, that error in mm, and the grid's size."""
    total: dict[Setting, float] = {}
    folds = touches.tuning_folds()
    for (train, test), scale, metric in product(folds, SCALES, METRICS):
        known_mm = touches.place_mm[train]
        centre_mm = known_mm.mean(axis=0)
        inputs, others = _features(touches.response[train], touches.response[test], known_mm, scale, metric)
        near, far = cdist(inputs, inputs), cdist(others, inputs)
        middle = np.median(near)
        for kind, width in product(KERNELS, WIDTHS):
            value, vector = np.linalg.eigh(_kernel(near / middle / width, kind))
            across = _kernel(far / middle / width, kind) @ vector
            projected = vector.T @ (known_mm - centre_mm)
            for penalty in PENALTIES:
                said_mm = across @ (projected / (np.maximum(value, 0) + penalty)[:, None]) + centre_mm
                setting = Setting(scale, metric, kind, width, penalty)
                error_mm = errors_mm(said_mm, touches.place_mm[test]).mean() / len(folds)
                total[setting] = total.get(setting, 0.0) + error_mm
    best = min(total, key=lambda setting: total[setting])
    return best, total[best], len(total)


def predict(touches: SkinTouches, setting: Setting) -> Array:
    """(500,2) places in mm of the held-out touches, learned from all early ones."""
    train, test = touches.early, touches.held_out
    known_mm = touches.place_mm[train]
    centre_mm = known_mm.mean(axis=0)
    inputs, others = _features(touches.response[train], touches.response[test], known_mm, setting.scale, setting.metric)
    near, far = cdist(inputs, inputs), cdist(others, inputs)
    unit = np.median(near) * setting.width
    kernel = _kernel(near / unit, setting.kernel) + setting.penalty * np.eye(len(inputs))
    return _kernel(far / unit, setting.kernel) @ np.linalg.solve(kernel, known_mm - centre_mm) + centre_mm
