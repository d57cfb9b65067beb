"""What families in no list share: their base, and places to put a fault at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .effect import Effect
from .skin import Skin

Array = NDArray[np.float64]


class Unlisted(Effect):
    """An effect that no name covers."""

    listed = False
    form = "only"


def _inside(skin: Skin, rng: np.random.Generator, low: float = 0.25, high: float = 0.75) -> Array:
    """A place on the sheet away from its rim, near a sensing point."""
    box = skin.box_m
    share = (skin.taxel_m - box[0]) / (box[1] - box[0])
    fit = np.flatnonzero(((share >= low) & (share <= high)).all(axis=1))
    return np.asarray(skin.taxel_m[int(rng.choice(fit if len(fit) else np.arange(len(skin.taxel_m))))])


def _along(point_m: Array, start: Array, stop: Array) -> tuple[Array, Array]:
    """Distance of points from a stretch, and how far along it (0 to 1) they lie."""
    way = stop - start
    share = np.clip((point_m - start) @ way / (way @ way), 0.0, 1.0)
    return np.hypot(*(point_m - start - share[:, None] * way).T), share


def _way(rng: np.random.Generator) -> Array:
    """A direction in the plane."""
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([np.cos(angle), np.sin(angle)])


def _pressed(skin: Skin, rng: np.random.Generator, beside_m: float = 0.0) -> Array:
    """A place that the plan presses, or so far beside it."""
    press = skin.plan.presses[int(rng.integers(len(skin.plan.presses)))]
    return np.asarray(press.position_m[0] + beside_m * _way(rng))


def _deepest_m(skin: Skin) -> float:
    """Depth of the plan's deepest press."""
    return max(float(np.max(press.depth_m)) for press in skin.plan.presses)


def _areas(point_m: Array) -> Array:
    """(n,) about the area that each of the places stands for, from how far its twelfth neighbour is."""
    return np.asarray(np.pi / 12.0 * cKDTree(point_m).query(point_m, k=13)[0][:, -1] ** 2)
