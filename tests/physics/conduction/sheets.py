"""Sheets the conduction tests share."""

from __future__ import annotations

import numpy as np

from ertskin.physics.conduction.mesh import SheetMesh
from ertskin.physics.sensor import Sensor, rectangle_m


def padded_sheet() -> Sensor:
    """The paper's kind of sheet: 24 pads of 4 mm, 20 round the rim and 4 inside, on 120 mm of 18 kohm/sq."""
    line = np.linspace(0.005, 0.115, 6)
    low, high = np.full(5, line[0]), np.full(5, line[-1])
    rim = [(line[:-1], low), (high, line[:-1]), (line[:0:-1], high), (low, line[:0:-1])]
    inner = np.array([[0.04, 0.04], [0.08, 0.04], [0.04, 0.08], [0.08, 0.08]])
    center = np.concatenate([*(np.stack(side, axis=1) for side in rim), inner])
    return Sensor(rectangle_m((0.12, 0.12)), 18_000.0, 10.0, center, np.full((24, 2), 0.004))


def small_sheet() -> Sensor:
    """Five pads on a 30 mm by 20 mm sheet of 1 kohm/sq."""
    center = np.array([[0.004, 0.004], [0.026, 0.004], [0.026, 0.016], [0.004, 0.016], [0.015, 0.009]])
    return Sensor(rectangle_m((0.03, 0.02)), 1_000.0, 50.0, center, np.full((5, 2), 0.003))


def tank(electrodes: int = 16, corners: int = 192, radius_m: float = 0.1) -> Sensor:
    """A round tank with electrodes over half of its wall."""
    angle = 2 * np.pi * np.arange(corners) / corners
    outline = radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    step = corners // electrodes
    first = step * np.arange(electrodes)
    edge = np.stack([outline[first], outline[(first + step // 2) % corners]], axis=1)
    return Sensor(outline, 1.0, 1.0, electrode_edge_m=edge)


def product_mesh(x: np.ndarray, y: np.ndarray) -> SheetMesh:
    """Rectangles cut in two, with electrodes along the whole left and the whole right side."""
    point = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(point)).reshape(len(x), len(y))
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    triangle = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3)
    left = np.stack([number[0, 1:], number[0, :-1]], axis=1)
    right = np.stack([number[-1, :-1], number[-1, 1:]], axis=1)
    return SheetMesh(point, triangle, np.full(len(triangle), -1), (left, right))


def wavy(position_m: np.ndarray, level_s: float, length_m: float = 0.01) -> np.ndarray:
    """A smooth positive conductivity in siemens that differs everywhere."""
    x, y = np.moveaxis(position_m, -1, 0) / length_m
    return level_s * (1.5 + np.sin(x + 0.3) * np.cos(0.7 * y) + 0.3 * np.sin(0.4 * x * y))
