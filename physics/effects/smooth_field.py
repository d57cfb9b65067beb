"""A smooth scalar field over the sheet given by its values on a square grid of nodes."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from ertskin.physics.effects.effect import Array

Nodes = tuple[tuple[float, ...], ...]

SPOTS = 5
"""Gaussian spots are tried at SPOTS x SPOTS places."""
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
    radius_m = 0.6 * float((high - low).min()) / SPOTS
    for x_m in np.linspace(low[0], high[0], 2 * SPOTS + 1)[1::2]:
        for y_m in np.linspace(low[1], high[1], 2 * SPOTS + 1)[1::2]:
            yield float(x_m), float(y_m), radius_m


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
