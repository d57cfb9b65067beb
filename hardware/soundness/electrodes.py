"""Electrodes: on the sheet, apart from one another, neither tiny nor huge. The limits are those of the sheet's mesh."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.plausibility import Doubt
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

MOST_ELECTRODES = 256
SHORTEST_M = 1e-4
"""Least side of a pad, and least length of an electrode on the outline."""
LEAST_GAP = 0.04
"""Of a pad's shorter side: what it keeps from other pads and from the outline."""
OFF_OUTLINE = 1e-3
"""Of the perimeter per electrode: how far the end of an electrode may lie off the outline."""


def electrode_faults(sensor: Sensor) -> Iterator[Doubt]:
    """What is wrong with pads or with electrodes on the outline."""
    if sensor.electrodes > MOST_ELECTRODES:
        yield Doubt("/sensor", f"{sensor.electrodes} electrodes", f"{MOST_ELECTRODES} at most")
        return
    guess = sensor.contact_resistance_guess_ohm
    if not 1e-9 <= guess <= 1e9:
        yield Doubt("/sensor/contact_resistance_guess_ohm", f"{guess:g} ohm", "1e-09 to 1e+09 ohm")
    if sensor.electrode_edge_m is not None:
        yield from _edge_faults(sensor.outline_m, np.asarray(sensor.electrode_edge_m))
    elif sensor.electrodes:
        yield from _pad_faults(sensor.outline_m, sensor.electrode_center_m, sensor.electrode_size_m)


def _pad_faults(outline_m: Array, center_m: Array, size_m: Array) -> Iterator[Doubt]:
    field, half, gap = "/sensor/electrode_center_m", 0.5 * size_m, LEAST_GAP * size_m.min(axis=1)
    tiny = np.flatnonzero(size_m.min(axis=1) < SHORTEST_M)
    if len(tiny):
        found = f"electrode {tiny[0]} {1e3 * size_m[tiny[0]].min():.3g} mm wide"
        yield Doubt("/sensor/electrode_size_m", found, f"{1e3 * SHORTEST_M:g} mm at least")
    room = np.array([_room_m(c, h, outline_m) for c, h in zip(center_m, half, strict=True)])
    outside = np.flatnonzero(room < gap)
    if len(outside):
        k = outside[0]
        where = f"({1e3 * center_m[k, 0]:.4g}, {1e3 * center_m[k, 1]:.4g}) mm"
        how = "at or across the outline, or outside the sheet"
        yield Doubt(field, f"electrode {k} at {where} {how}", "pads that lie inside the sheet")
    apart = (np.abs(center_m[:, None] - center_m) - (half[:, None] + half)).max(axis=-1)
    np.fill_diagonal(apart, np.inf)
    close = np.argwhere(apart < np.maximum(gap[:, None], gap))
    if len(close):
        a, b = close[0]
        how = "at one place" if np.array_equal(center_m[a], center_m[b]) else "overlapping or nearly so"
        yield Doubt(field, f"electrodes {a} and {b} {how}", f"pads apart by {LEAST_GAP:g} of their width or more")


def _room_m(center_m: Array, half_m: Array, outline_m: Array) -> float:
    """How far a pad stays from the outline in metre; negative where it isn't wholly inside."""
    following = np.roll(outline_m, -1, axis=0)
    corners = center_m + half_m * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    if not _inside(np.vstack([corners, center_m]), outline_m).all():
        return -1.0
    to_outline = min(_distance_m(corner, outline_m, following).min() for corner in corners)
    to_its_corners = np.hypot(*np.maximum(np.abs(outline_m - center_m) - half_m, 0.0).T).min()
    return float(min(to_outline, to_its_corners))


def _inside(point: Array, outline_m: Array) -> NDArray[np.bool_]:
    """(n,) whether points (n,2) lie inside a closed polygon, by the even-odd rule."""
    (x0, y0), (x1, y1) = outline_m.T, np.roll(outline_m, -1, axis=0).T
    x, y = point[:, :1], point[:, 1:]
    spans = (y0 > y) != (y1 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        left = x < x0 + (y - y0) * (x1 - x0) / (y1 - y0)
    return np.asarray((spans & left).sum(axis=1) % 2 == 1)


def _distance_m(point: Array, start: Array, stop: Array) -> Array:
    """(n,) distances of a point from n segments."""
    vector = stop - start
    along = np.clip(((point - start) * vector).sum(axis=1) / np.maximum((vector**2).sum(axis=1), 1e-300), 0.0, 1.0)
    return np.asarray(np.hypot(*(point - start - along[:, None] * vector).T))


def _edge_faults(outline_m: Array, edge_m: Array) -> Iterator[Doubt]:
    field = "/sensor/electrode_edge_m"
    following = np.roll(outline_m, -1, axis=0)
    side = np.hypot(*(following - outline_m).T)
    before, around = np.concatenate([[0.0], np.cumsum(side)[:-1]]), float(side.sum())
    arc = np.empty(edge_m.shape[:2])
    for place in np.ndindex(*arc.shape):
        away = _distance_m(edge_m[place], outline_m, following)
        nearest = int(away.argmin())
        if away[nearest] > OFF_OUTLINE * around / len(edge_m):
            found = f"electrode {place[0]} with an end {1e3 * away[nearest]:.3g} mm off the outline"
            yield Doubt(field, found, "ends on the outline")
            return
        arc[place] = before[nearest] + np.hypot(*(edge_m[place] - outline_m[nearest]))
    length = (arc[:, 1] - arc[:, 0]) % around
    tiny = np.flatnonzero(length < SHORTEST_M)
    if len(tiny):
        found = f"electrode {tiny[0]} {1e3 * length[tiny[0]]:.3g} mm long"
        yield Doubt(field, found, f"{1e3 * SHORTEST_M:g} mm at least")
    order = np.argsort(arc[:, 0] % around)
    ahead = (np.roll(arc[order, 0], -1) - arc[order, 0]) % around
    over = np.flatnonzero((length[order] > ahead * (1 + 1e-9)) if len(order) > 1 else [])
    if len(over):
        a, b = order[over[0]], order[(over[0] + 1) % len(order)]
        how = "overlapping, or given clockwise"
        yield Doubt(field, f"electrodes {a} and {b} {how}", "electrodes apart, each counter-clockwise")
