"""Sheets whose pair resistance is known in closed form, and the order at which the triangles approach it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ive
from sheets import product_mesh

from ertskin.physics.conduction.mesh import SheetMesh
from ertskin.physics.conduction.sheet import SheetModel


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_patch_a_strip_between_two_edges(degree: int) -> None:
    rng = np.random.default_rng(0)
    mesh = product_mesh(np.r_[0, np.sort(rng.random(5)), 1] * 0.3, np.r_[0, np.sort(rng.random(3)), 1] * 0.1)
    moved = mesh.point_m.copy()
    inside = (moved > 1e-9).all(axis=1) & (moved < np.array([0.3, 0.1]) - 1e-9).all(axis=1)
    moved[inside] += rng.uniform(-1, 1, (inside.sum(), 2)) * 2e-3
    model = SheetModel.from_mesh(replace(mesh, point_m=moved), degree)
    solution = model.solve(model.uniform(500.0), np.array([7.0, 11.0]))
    assert solution.pair_resistance_ohm[0] == pytest.approx(500.0 * 3 + 7.0 + 11.0, rel=1e-12)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_patch_an_anisotropic_strip(degree: int) -> None:
    model = SheetModel.from_mesh(product_mesh(np.linspace(0, 0.3, 5), np.linspace(0, 0.1, 4)), degree)
    tensor = np.broadcast_to([2e-3, 0.0, 5e-3], (*model.weight_m2.shape, 3))
    solution = model.solve(tensor, np.array([1.0, 1.0]))
    assert solution.pair_resistance_ohm[0] == pytest.approx(3 / 2e-3 + 2.0, rel=1e-12)


def strip_with_pad(cells: int) -> SheetMesh:
    """A strip 0.3 m by 0.1 m: a pad over its first 0.1 m, an edge electrode at its far end."""
    x = np.concatenate([np.linspace(0, 0.1, cells + 1), np.linspace(0.1, 0.3, cells + 1)[1:]])
    mesh = product_mesh(x, np.linspace(0, 0.1, 3))
    pad = np.where(mesh.point_m[mesh.triangle].mean(axis=1)[:, 0] < 0.1, 0, -1)
    return SheetMesh(mesh.point_m, mesh.triangle, pad, (np.zeros((0, 2), dtype=np.intp), mesh.edge[1]))


@pytest.mark.parametrize(("degree", "cells"), [(1, 16), (2, 4), (3, 3)])
def test_order_of_a_strip_with_a_pad(degree: int, cells: int) -> None:
    sheet, contact = 200.0, 5.0
    reach = np.sqrt(contact * 0.01 / sheet)
    exact = sheet * 2.0 + 1.0 + sheet * reach / 0.1 / np.tanh(0.1 / reach)
    error = []
    for refinement in (1, 2, 4):
        model = SheetModel.from_mesh(strip_with_pad(cells * refinement), degree)
        solution = model.solve(model.uniform(sheet), np.array([contact, 1.0]))
        error.append(abs(solution.pair_resistance_ohm[0] - exact))
    order = np.log2(error[1] / error[2])
    assert order == pytest.approx(2 * degree, abs=0.35)
    assert error[0] > error[1] > error[2]


def disk(rings: int, sides: int, pad_m: float, radius_m: float) -> SheetMesh:
    """A round sheet, a round pad in its middle, one electrode all round its rim."""
    split = rings // 2
    radius = np.concatenate([np.linspace(0, pad_m, split + 1)[1:], np.geomspace(pad_m, radius_m, split + 1)[1:]])
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))], axis=-1).reshape(-1, 2)
    point = np.concatenate([[[0.0, 0.0]], ring])
    number = 1 + np.arange(len(radius) * sides).reshape(len(radius), sides)
    following = np.roll(number, -1, axis=1)
    core = np.stack([np.zeros(sides, dtype=np.intp), number[0], following[0]], axis=1)
    a, b, c, d = number[:-1], number[1:], following[1:], following[:-1]
    outer = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3)
    triangle = np.concatenate([core, outer])
    distance = np.linalg.norm(point[triangle].mean(axis=1), axis=1)
    pad = np.where(distance < pad_m, 0, -1)
    rim = np.stack([number[-1], following[-1]], axis=1)
    return SheetMesh(point, triangle, pad, (np.zeros((0, 2), dtype=np.intp), rim))


@pytest.mark.parametrize("contact", [10.0, 50.0, 500.0])
def test_disk_with_a_pad_and_a_ring(contact: float) -> None:
    """Modified Bessel functions under the pad, a logarithm beyond it, a contact all round."""
    sheet, pad_m, radius_m, ring = 1_000.0, 0.02, 0.1, 30.0
    reach = np.sqrt(contact * np.pi * pad_m**2 / sheet)
    under = sheet * reach / (2 * np.pi * pad_m) * ive(0, pad_m / reach) / ive(1, pad_m / reach)
    exact = under + sheet * np.log(radius_m / pad_m) / (2 * np.pi) + ring
    error = []
    for sides in (48, 96):
        model = SheetModel.from_mesh(disk(sides // 2, sides, pad_m, radius_m), 2)
        solution = model.solve(model.uniform(sheet), np.array([contact, ring]))
        error.append(solution.pair_resistance_ohm[0] / exact - 1)
    # Both circles are polygons of one shape, which leaves the logarithm as it is: the order is the triangles' own.
    assert abs(error[1]) < 5e-6
    assert error[0] / error[1] == pytest.approx(16.0, rel=0.1)
