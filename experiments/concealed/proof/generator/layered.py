"""Normal stress inside a bonded stack of elastic layers on a rigid plate, under point forces on its top.

Love's strain function in every layer, matched at the interfaces, one Hankel wavenumber at a time (Love, Treatise, 1927,
art. 188; Burmister, J. Appl. Phys. 16, 1945). The stack is unbounded sideways: a pad that reaches six thicknesses
beyond the sheet can't be told from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.special import j0, j1

Array = NDArray[np.float64]
DEEP = 30.0
"""Wavenumber times top thickness from which the top layer is a half-space."""


@dataclass(frozen=True)
class Layer:
    """One layer: its name, thickness (m), Young's modulus (Pa), Poisson's ratio."""

    name: str
    thickness_m: float
    youngs_modulus_pa: float
    poissons_ratio: float


def _rows(f: Array, f1: Array, f2: Array, f3: Array, layer: Layer) -> Array:
    """(n,4,basis) normal stress, shear stress, k u_z, k u_r of Love functions with derivatives by kz."""
    nu = layer.poissons_ratio
    twice_shear = layer.youngs_modulus_pa / (1.0 + nu)
    normal = (1.0 - nu) * f3 - (2.0 - nu) * f1
    shear = nu * f2 + (1.0 - nu) * f
    down = ((1.0 - 2.0 * nu) * f2 - 2.0 * (1.0 - nu) * f) / twice_shear
    return np.stack([normal, shear, down, f1 / twice_shear], axis=1)


def _faces(layer: Layer, k: Array) -> tuple[Array, Array]:
    """(n,4,4) stresses and displacements at a layer's top and bottom for its four Love functions."""
    height = k * layer.thickness_m
    sides = []
    for s in (np.zeros_like(height), height):
        t = height - s
        a, b = np.exp(-s), np.exp(-t)
        f = np.stack([a, s * a, b, t * b], axis=-1)
        f1 = np.stack([-a, (1 - s) * a, b, -(1 - t) * b], axis=-1)
        f2 = np.stack([a, (s - 2) * a, b, (t - 2) * b], axis=-1)
        f3 = np.stack([-a, (3 - s) * a, b, -(3 - t) * b], axis=-1)
        sides.append(_rows(f, f1, f2, f3, layer))
    return sides[0], sides[1]


def spectra(layers: Sequence[Layer], interface: int, k: Array) -> tuple[Array, Array]:
    """Interface pressure and k times the surface's sinking, both (n,), for a unit normal load of wavenumber k (1/m)."""
    count = len(layers)
    system = np.zeros((len(k), 4 * count, 4 * count))
    load = np.zeros((len(k), 4 * count, 1))
    faces = [_faces(layer, k) for layer in layers]
    # Displacements are scaled by the top layer's modulus: rows of stress and of displacement are then alike in size.
    scale = np.array([1.0, 1.0, layers[0].youngs_modulus_pa, layers[0].youngs_modulus_pa])[:, None]
    system[:, :2, :4] = faces[0][0][:, :2]
    load[:, 0] = -1.0
    for i in range(count - 1):
        row = 2 + 4 * i
        system[:, row : row + 4, 4 * i : 4 * i + 4] = faces[i][1] * scale
        system[:, row : row + 4, 4 * i + 4 : 4 * i + 8] = -faces[i + 1][0] * scale
    system[:, -2:, -4:] = faces[-1][1][:, 2:] * scale[2:]
    weights = np.linalg.solve(system, load)[..., 0]
    own = weights[:, 4 * interface : 4 * interface + 4]
    pressure = -np.einsum("nb,nb->n", faces[interface][1][:, 0], own)
    sinking = np.einsum("nb,nb->n", faces[0][0][:, 2], weights[:, :4])
    return pressure, sinking


def _nodes(upper: float, panels: int) -> tuple[Array, Array]:
    x, w = np.polynomial.legendre.leggauss(8)
    edges = np.linspace(0.0, upper, panels + 1)
    half = 0.5 * np.diff(edges)
    return (edges[:-1, None] + half[:, None] * (x + 1.0)).ravel(), (half[:, None] * w).ravel()


def point_pressure(layers: Sequence[Layer], interface: int, reach_m: float = 0.06) -> CubicSpline:
    """Interface pressure (Pa) at distance r (m) from a point force of 1 N; zero slope at r = 0, up to ``reach_m``."""
    depth = sum(layer.thickness_m for layer in layers[: interface + 1])
    k, w = _nodes(45.0 / depth, 160)
    pressure, _ = spectra(layers, interface, k)
    r = reach_m * np.linspace(0.0, 1.0, 241) ** 1.5
    values = j0(np.outer(r, k)) @ (pressure * k * w) / (2.0 * np.pi)
    return CubicSpline(r, values, bc_type=((1, 0.0), "not-a-knot"))


def stiffness_n_per_m(layers: Sequence[Layer], interface: int, diameter_m: float, points_m: Array) -> float:
    """Force over the mean sinking of the indenter's disk, for the force shared by ``points_m``."""
    radius = 0.5 * diameter_m
    k, w = _nodes(400.0 / radius, 3000)
    shallow = k * layers[0].thickness_m < DEEP
    sinking = np.full(len(k), 2.0 * (1.0 - layers[0].poissons_ratio ** 2) / layers[0].youngs_modulus_pa)
    sinking[shallow] = spectra(layers, interface, k[shallow])[1]
    mean = np.mean([j0(k * np.hypot(*p)) for p in points_m], axis=0) * 2.0 * j1(k * radius) / (k * radius)
    return float(2.0 * np.pi / np.sum(sinking * mean * w))
