"""Maps of a sheet as it is made and worn: seams, rolls joined, lots of patches, wrinkles, hills, gradients.

None is a Gaussian process. Every map is drawn for a box and returns values of about unit size at (n,2) places.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Map = Callable[[Array], Array]


def _line(rng: np.random.Generator, low: Array, high: Array) -> tuple[Array, Array]:
    """A point well inside and a unit normal."""
    angle = rng.uniform(0.0, np.pi)
    return low + (high - low) * rng.uniform(0.3, 0.7, 2), np.array([np.cos(angle), np.sin(angle)])


def seam(rng: np.random.Generator, low: Array, high: Array) -> Map:
    """A straight band with soft edges where two cloths overlap."""
    point, normal = _line(rng, low, high)
    half, soft = rng.uniform(2e-3, 5e-3), 8e-4
    return lambda x: 0.5 * (np.tanh((half - np.abs((x - point) @ normal)) / soft) + 1.0)


def rolls(rng: np.random.Generator, low: Array, high: Array) -> Map:
    """Cloth of two rolls joined along a line: a step."""
    point, normal = _line(rng, low, high)
    return lambda x: np.tanh((x - point) @ normal / 1.5e-3)


def lots(rng: np.random.Generator, low: Array, high: Array) -> Map:
    """Square patches from different lots: a chequer of uniform values."""
    pitch = float(min(high - low)) / int(rng.integers(4, 7))
    count = np.ceil((high - low) / pitch).astype(int) + 1
    value = rng.uniform(-1.5, 1.5, count)

    def at(x: Array) -> Array:
        cell = np.clip(((x - low) / pitch).astype(int), 0, count - 1)
        return np.asarray(value[cell[:, 0], cell[:, 1]])

    return at


def wrinkles(rng: np.random.Generator, low: Array, high: Array) -> Map:
    """Parallel wrinkles that die away from where the cloth was gathered."""
    point, normal = _line(rng, low, high)
    length, reach, phase = rng.uniform(0.018, 0.032), 0.35 * float(np.hypot(*(high - low))), rng.uniform(0, 2 * np.pi)
    return lambda x: (
        1.4
        * np.sin(2 * np.pi * (x - point) @ normal / length + phase)
        * np.exp(-(((x - point) ** 2).sum(axis=1) / reach**2))
    )


def hills(rng: np.random.Generator, low: Array, high: Array) -> Map:
    """Two to four flat-topped hills and hollows."""
    count = int(rng.integers(2, 5))
    center = low + (high - low) * rng.uniform(0.1, 0.9, (count, 2))
    radius, height = rng.uniform(0.012, 0.028, count), rng.choice([-1.0, 1.0], count) * rng.uniform(0.8, 1.6, count)

    def at(x: Array) -> Array:
        squared = ((x[:, None] - center) ** 2).sum(axis=2) / radius**2
        return np.asarray((height / (1.0 + squared**2)).sum(axis=1))

    return at


def gradient(rng: np.random.Generator, low: Array, high: Array) -> Map:
    """A coating that runs out towards one side, faster near its end."""
    angle = rng.uniform(0, 2 * np.pi)
    way, middle, half = np.array([np.cos(angle), np.sin(angle)]), 0.5 * (low + high), 0.5 * float(np.max(high - low))
    return lambda x: np.expm1(1.2 * (x - middle) @ way / half) - 0.3


MAPS = {"seam": seam, "rolls": rolls, "lots": lots, "wrinkles": wrinkles, "hills": hills, "gradient": gradient}
