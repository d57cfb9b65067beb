"""The sheet's outline: a simple polygon of a size that can be made, and meshed in reasonable time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.plausibility import Doubt
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

MOST_CORNERS = 2000
NARROWEST_M = 2e-3
"""Least mean width of a sheet: twice its area over its perimeter."""
LONGEST_M = 2.0
LARGEST_M2 = 1.0


def sheet_faults(sensor: Sensor) -> Iterator[Doubt]:
    """What is wrong with the outline."""
    outline = sensor.outline_m
    field = "/sensor/outline_m or size_m"
    if len(outline) > MOST_CORNERS:
        yield Doubt("/sensor/outline_m", f"{len(outline)} corners", f"{MOST_CORNERS} at most")
        return
    length, area = float(np.ptp(outline, axis=0).max()), area_m2(outline)
    if length > LONGEST_M or area > LARGEST_M2:
        expected = f"{LONGEST_M:g} m and {LARGEST_M2:g} m2 at most"
        yield Doubt(field, f"a sheet {length:g} m long, {area:g} m2 large", expected)
    width = 2.0 * area / float(np.hypot(*(np.roll(outline, -1, axis=0) - outline).T).sum())
    if width < NARROWEST_M:
        yield Doubt(field, f"a sheet {1e3 * width:.3g} mm wide in the mean", f"{1e3 * NARROWEST_M:g} mm at least")
    if crossing := first_crossing(outline):
        found = "sides {} and {} that cross or touch".format(*crossing)
        yield Doubt("/sensor/outline_m", found, "a polygon that does not cross itself")


def area_m2(outline_m: Array) -> float:
    """Signed area of a closed polygon (N,2): positive where it runs counter-clockwise."""
    x, y = outline_m.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def first_crossing(outline_m: Array) -> tuple[int, int] | None:
    """Two sides of a closed polygon (N,2) that meet elsewhere than at a common corner, or None."""
    start = outline_m
    vector = np.roll(outline_m, -1, axis=0) - outline_m
    count = len(start)
    for k in range(count):
        # A side meets its two neighbours at their common corners.
        others = (k + np.arange(2, count - 1)) % count
        if not vector[k].any():
            return k, (k + 1) % count
        meets = others[_meet(start[k], vector[k], start[others], vector[others])]
        if len(meets):
            return k, int(meets[0])
        following = (k + 1) % count
        if _cross(vector[k], vector[following]) == 0.0 and vector[k] @ vector[following] < 0.0:
            return k, following
    return None


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _meet(start: Array, vector: Array, starts: Array, vectors: Array) -> NDArray[np.bool_]:
    """(n,) whether a segment meets each of n others."""
    own = _cross(vector, starts - start) * _cross(vector, starts + vectors - start)
    theirs = _cross(vectors, start - starts) * _cross(vectors, start + vector - starts)
    level = (_cross(vector, starts - start) == 0) & (_cross(vector, starts + vectors - start) == 0)
    apart = _apart(start, start + vector, starts, starts + vectors)
    return (own <= 0) & (theirs <= 0) & ~(level & apart)


def _apart(a: Array, b: Array, c: Array, d: Array) -> NDArray[np.bool_]:
    """(n,) whether the bounding boxes of the segments ab and cd (n,2) are apart."""
    low, high = np.minimum(a, b), np.maximum(a, b)
    return np.asarray((np.maximum(c, d) < low).any(axis=-1) | (np.minimum(c, d) > high).any(axis=-1))
