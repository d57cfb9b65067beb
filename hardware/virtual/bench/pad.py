"""The bench's layered pad: a two-dimensional Fourier series in the plane, spectral elements through the thickness.

For each wavenumber k the layers answer a surface load cos(kx) with u_x = U(z) sin(kx), u_z = W(z) cos(kx), which
minimise a quadratic energy in (U, W); Gauss-Lobatto elements through every layer solve that, and the reaction at the
interface is its normal pressure. The plane is periodic with a period far longer than the pad is thick.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.special import j1

from ertskin.hardware.virtual.bench.sheet import gauss_lobatto
from ertskin.physics.sensor import Layer

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PadResolution:
    """How finely the pad is cut: polynomial degree through a layer, period and Fourier modes per direction."""

    degree: int = 8
    period_m: float = 0.12
    modes: int = 224
    wavenumbers: int = 320


class FourierPad:
    """Interface pressure and indenter stiffness of a bonded stack of linear elastic layers on a rigid plate.

    ``interface`` is the number of the layer whose lower face is the piezoresistive interface. The surface is loaded by
    point forces, each an equal part of the force, at ``points_m`` (n,2) from the indenter's axis.
    """

    reach_m = 0.045

    def __init__(
        self,
        layers: Sequence[Layer],
        interface: int,
        points_m: Array,
        diameter_m: float,
        resolution: PadResolution | None = None,
    ) -> None:
        resolution = resolution or PadResolution()
        self.points_m = points_m
        half = resolution.modes // 2
        wave = 2 * np.pi / resolution.period_m
        largest = np.sqrt(2.0) * half * wave
        sample = largest * np.linspace(0.0, 1.0, resolution.wavenumbers) ** 1.5
        sinking, pressure = self._answers(layers, interface, sample, resolution.degree)
        steps = wave * np.arange(-half, half + 1)
        k = np.hypot(steps[:, None], steps)
        cells = 1.0 / resolution.period_m**2
        along = cells * CubicSpline(sample, pressure)(k).sum(axis=1)
        distance = np.linspace(0.0, self.reach_m, 1201)
        values = np.cos(distance[:, None] * steps) @ along
        self._kernel = CubicSpline(distance, values, bc_type=((1, 0.0), "not-a-knot"))
        ka = k * diameter_m / 2
        disc = np.where(ka > 0, 2 * j1(np.maximum(ka, 1e-12)) / np.maximum(ka, 1e-12), 1.0)
        compliance = cells * (CubicSpline(sample, sinking)(k) * disc**2).sum()
        self.stiffness_n_per_m = float(1.0 / compliance)

    @staticmethod
    def _answers(layers: Sequence[Layer], interface: int, k: Array, degree: int) -> tuple[Array, Array]:
        """Sinking per unit surface pressure (m/Pa) and interface pressure ratio, for each wavenumber (rad/m)."""
        _, weight, slope = gauss_lobatto(degree)
        stiff = slope.T * weight @ slope
        mixed = slope.T * weight
        slabs: list[tuple[float, float, float]] = []
        above = 0
        for number, layer in enumerate(layers):
            shear = layer.youngs_modulus_pa / (2 * (1 + layer.poissons_ratio))
            lame = 2 * shear * layer.poissons_ratio / (1 - 2 * layer.poissons_ratio)
            pieces = 4 if layer.thickness_m > 1e-3 else 1
            slabs += [(layer.thickness_m / pieces, lame, shear)] * pieces
            above += pieces if number <= interface else 0
        nodes = len(slabs) * degree + 1
        system = np.zeros((len(k), 2 * nodes, 2 * nodes))
        partial = np.zeros_like(system)
        kk = k[:, None, None]
        for number, (height, lame, shear) in enumerate(slabs):
            u = slice(number * degree, number * degree + degree + 1)
            w = slice(nodes + u.start, nodes + u.stop)
            mass, bulk = np.diag(weight) * height / 2, lame + 2 * shear
            block = np.zeros((len(k), 2, degree + 1, 2, degree + 1))
            block[:, 0, :, 0] = bulk * kk**2 * mass + shear * stiff * 2 / height
            block[:, 1, :, 1] = bulk * stiff * 2 / height + shear * kk**2 * mass
            # z counts downwards and W is positive downwards: shear strain U' - kW, normal strains kU and W'.
            coupling = lame * kk * mixed.T - shear * kk * mixed
            block[:, 0, :, 1] = coupling
            block[:, 1, :, 0] = coupling.transpose(0, 2, 1)
            for into in (system, partial) if number < above else (system,):
                into[:, u, u] += block[:, 0, :, 0]
                into[:, u, w] += block[:, 0, :, 1]
                into[:, w, u] += block[:, 1, :, 0]
                into[:, w, w] += block[:, 1, :, 1]
        free = np.concatenate([np.arange(nodes - 1), nodes + np.arange(nodes - 1)])
        load = np.zeros((2 * nodes, 1))
        load[nodes] = 1.0
        moved = np.zeros((len(k), 2 * nodes, 1))
        moved[:, free] = np.linalg.solve(
            system[:, free[:, None], free], np.broadcast_to(load[free], (len(k), len(free), 1))
        )
        reaction = partial[:, nodes + above * degree][:, None, :] @ moved
        return moved[:, nodes, 0], -reaction[:, 0, 0]

    def point_pressure_pa(self, distance_m: Array) -> Array:
        """Pa per newton at a distance from one point force; nothing beyond ``reach_m``."""
        inside = distance_m < self.reach_m
        return np.where(inside, self._kernel(np.minimum(distance_m, self.reach_m)), 0.0)

    def pressure_pa(self, offset_m: Array) -> Array:
        """(...,) Pa per newton of the whole indenter at offsets (...,2) from its axis."""
        total = np.zeros(offset_m.shape[:-1])
        for point in self.points_m:
            total += self.point_pressure_pa(np.hypot(offset_m[..., 0] - point[0], offset_m[..., 1] - point[1]))
        return total / len(self.points_m)
