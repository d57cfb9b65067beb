"""A smooth scalar field over the sheet given by its values on a square grid of nodes."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from ertskin.physics.effects.effect import Array

Nodes = tuple[tuple[float, ...], ...]

SPOTS = 8
"""Gaussian spots are tried at SPOTS places along the sheet's longer side, and as many along the other as it is long."""
RADII = 0.6, 1.2, 2.4
"""Their standard deviations, over the distance between the places."""
ANGLES, OFFSETS = 12, 24
"""Directions in which lines are tried, and places in each."""
WIDTHS = 1.0, 2.5
"""Widths of lines tried, over the distance between them."""
MOST_KEPT = 4000
"""Places of one array, more of which aren't remembered."""


def field_at(nodes: Nodes, position_m: Array, extent_m: Array) -> Array:
    """(...,) the natural bicubic spline through node values [row along y][column along x] at positions (...,2)."""
    values = np.asarray(nodes, dtype=float)
    rows, columns = values.shape
    along_x = _cardinal(columns, _unit(position_m[..., 0], extent_m[:, 0]))
    along_y = _cardinal(rows, _unit(position_m[..., 1], extent_m[:, 1]))
    return np.asarray(((along_y @ values) * along_x).sum(axis=-1))


def field_design(shape: tuple[int, int], position_m: Array, extent_m: Array) -> Array:
    """(..., rows*columns) derivative of ``field_at`` with respect to the node values, rows first."""
    along_x = _cardinal(shape[1], _unit(position_m[..., 0], extent_m[:, 0]))
    along_y = _cardinal(shape[0], _unit(position_m[..., 1], extent_m[:, 1]))
    return (along_y[..., :, None] * along_x[..., None, :]).reshape(*position_m.shape[:-1], shape[0] * shape[1])


def node_position_m(shape: tuple[int, int], extent_m: Array) -> Array:
    """(rows*columns, 2) where the nodes lie."""
    x = np.linspace(extent_m[0, 0], extent_m[1, 0], shape[1])
    y = np.linspace(extent_m[0, 1], extent_m[1, 1], shape[0])
    return np.stack([np.tile(x, shape[0]), np.repeat(y, shape[1])], axis=1)


def spots_over(extent_m: Array) -> Iterator[tuple[float, float, float]]:
    """Middles and radius in metre of the spots that a search begins with, all over a sheet's box (2,2)."""
    low, high = extent_m
    apart_m = float((high - low).max()) / SPOTS
    places = [low[k] + apart_m * (np.arange(round(float(high[k] - low[k]) / apart_m)) + 0.5) for k in range(2)]
    for radius in RADII:
        for x_m in places[0]:
            for y_m in places[1]:
                yield float(x_m), float(y_m), radius * apart_m


def lines_over(extent_m: Array) -> Iterator[tuple[float, float, float]]:
    """Angle, offset from the middle and width in metre of the lines that a search begins with, across the box (2,2)."""
    half = 0.5 * (extent_m[1] - extent_m[0])
    for angle_rad in np.pi / ANGLES * np.arange(ANGLES):
        reach = float(half @ np.abs([np.cos(angle_rad), np.sin(angle_rad)]))
        apart_m = 2 * reach / OFFSETS
        for offset_m in -reach + apart_m * (np.arange(OFFSETS) + 0.5):
            for width in WIDTHS:
                yield float(angle_rad), float(offset_m), width * apart_m


def _unit(coordinate: Array, ends: Array) -> Array:
    return np.clip((coordinate - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0)


def _cardinal(count: int, where: Array) -> Array:
    """(..., count) each node's own spline at places between 0 and 1; few places come again and again."""
    if where.size > MOST_KEPT:
        return np.asarray(_splines(count)(where))
    return _kept(count, where.shape, where.tobytes())


@lru_cache(maxsize=256)
def _kept(count: int, shape: tuple[int, ...], where: bytes) -> Array:
    found = np.asarray(_splines(count)(np.frombuffer(where).reshape(shape)))
    found.flags.writeable = False
    return found


@lru_cache(maxsize=16)
def _splines(count: int) -> CubicSpline:
    return CubicSpline(np.linspace(0.0, 1.0, count), np.eye(count), bc_type="natural")
