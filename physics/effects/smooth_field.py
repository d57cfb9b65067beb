"""A smooth scalar field over the sheet given by its values on a square grid of nodes."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from physics.effects.effect import Array

Nodes = tuple[tuple[float, ...], ...]


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


def _unit(coordinate: Array, ends: Array) -> Array:
    return np.clip((coordinate - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0)


def _cardinal(count: int, where: Array) -> Array:
    spline = CubicSpline(np.linspace(0.0, 1.0, count), np.eye(count), bc_type="natural")
    return np.asarray(spline(where))
