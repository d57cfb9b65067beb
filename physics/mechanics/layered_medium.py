"""The exact response of a bonded layered pad on a rigid plate to normal point forces, by Hankel transforms.

Under an axisymmetric normal load every field is a superposition of the harmonics J0(kr), J1(kr). Per wavenumber k and
depth z (downward) the unknowns are y = (U, W, T, S): radial and downward displacement, shear and normal stress, and

    U' = kW + T/mu                    W' = -nu/(1-nu) k U + (1-2nu)/(2 mu (1-nu)) S
    T' = 2 mu/(1-nu) k^2 U + nu/(1-nu) k S                                      S' = -kT

y' = A y has the double eigenvalues +k and -k, so exp(A h) is a cubic in A known in closed form. It is turned into the
4x4 stiffness matrix of a thin sublayer and doubled up to the layer's thickness: nothing ever grows like exp(kh), and
nothing cancels as kh -> 0 (the stiffness-matrix method, Kausel & Roesset, Bull. Seism. Soc. Am. 71 (1981) 1743).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import factorial

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipe, j0, j1

from ertskin.physics.sensor import Layer

Array = NDArray[np.float64]

_LONGEST_SUBLAYER = 0.5
"""Largest k times thickness for which a sublayer's stiffness is taken from the propagator."""

_DECAYED = 42.0
"""exp(-42) = 6e-19: harmonics with k times depth beyond this are below rounding."""


def _inverse(matrix: Array) -> Array:
    """Inverses of (..., 2, 2) matrices in closed form."""
    (a, b), (c, d) = np.moveaxis(matrix, (-2, -1), (0, 1))
    adjugate = np.moveaxis(np.array([[d, -b], [-c, a]]), (0, 1), (-2, -1))
    return adjugate / (a * d - b * c)[..., None, None]


def _propagator(poissons_ratio: float, wavenumber_per_m: Array, thickness_m: float) -> Array:
    """(K,4,4) exp(A h) by Sylvester's formula for the double eigenvalues +-k, in units of the layer's shear modulus."""
    nu, k, h = poissons_ratio, wavenumber_per_m, thickness_m
    a = np.zeros((len(k), 4, 4))
    a[:, 0, 1], a[:, 0, 2] = k, 1.0
    a[:, 1, 0], a[:, 1, 3] = -nu / (1 - nu) * k, (1 - 2 * nu) / (2 * (1 - nu))
    a[:, 2, 0], a[:, 2, 3] = 2 / (1 - nu) * k**2, nu / (1 - nu) * k
    a[:, 3, 2] = -k
    x = k * h
    # (x cosh x - sinh x)/x^3 by its series: the sublayers are thin (x <= 1/2), the closed form would cancel
    slope = np.sum([x ** (2 * n) * 2 * (n + 1) / factorial(2 * n + 3) for n in range(8)], axis=0)
    sinhc = np.sum([x ** (2 * n) / factorial(2 * n + 1) for n in range(9)], axis=0)
    unit = np.eye(4)
    nilpotent = a @ a - (k**2)[:, None, None] * unit
    even = np.cosh(x)[:, None, None] * unit + (0.5 * h**2 * sinhc)[:, None, None] * nilpotent
    odd = (h * sinhc)[:, None, None] * unit + (0.5 * h**3 * slope)[:, None, None] * nilpotent
    return even + a @ odd


def _layer_stiffness(layer: Layer, wavenumber_per_m: Array) -> tuple[Array, Array, Array]:
    """(K,2,2) blocks top-top, top-bottom, bottom-bottom of a layer's stiffness in Pa/m: forces from displacements."""
    shear_modulus = layer.youngs_modulus_pa / (2 * (1 + layer.poissons_ratio))
    blocks = _unit_stiffness(layer.poissons_ratio, layer.thickness_m, wavenumber_per_m.tobytes())
    top, across, bottom = (shear_modulus * block for block in blocks)
    return top, across, bottom


@lru_cache(maxsize=16)
def _unit_stiffness(poissons_ratio: float, thickness_m: float, wavenumbers: bytes) -> tuple[Array, Array, Array]:
    """``_layer_stiffness`` in 1/m, per Pa of shear modulus; ``wavenumbers`` are the bytes of (K,) float64.

    Remembered: whoever fits moduli changes nothing else.
    """
    wavenumber_per_m = np.frombuffer(wavenumbers)
    longest = float(wavenumber_per_m.max()) * thickness_m
    doublings = max(0, int(np.ceil(np.log2(longest / _LONGEST_SUBLAYER))))
    p = _propagator(poissons_ratio, wavenumber_per_m, thickness_m / 2**doublings)
    flexibility = _inverse(p[:, :2, 2:])
    top, across, bottom = flexibility @ p[:, :2, :2], -flexibility, p[:, 2:, 2:] @ flexibility
    for _ in range(doublings):
        middle = _inverse(bottom + top)
        transposed = np.swapaxes(across, -1, -2)
        top, across, bottom = (
            top - across @ middle @ transposed,
            -across @ middle @ across,
            bottom - transposed @ middle @ across,
        )
    return top, across, bottom


@dataclass(frozen=True)
class LayeredMedium:
    """Bonded layers, top to bottom, of unlimited width, the lowest one glued to a rigid plate; linear elastic.

    Radii and depths in metre; every result is for a normal force of one newton pressing down on the top surface.
    ``max_radius_m`` is the largest radius that will be asked for: it sets the quadrature over wavenumbers.
    """

    layers: tuple[Layer, ...]
    max_radius_m: float = 0.2

    def __post_init__(self) -> None:
        for layer in self.layers:
            if layer.thickness_m <= 0 or layer.youngs_modulus_pa <= 0 or not -1 < layer.poissons_ratio <= 0.5:
                raise ValueError(
                    f"layer {layer.name!r} needs thickness > 0, modulus > 0 and -1 < Poisson's ratio <= 0.5"
                )
        if not self.layers:
            raise ValueError("a pad needs at least one layer")

    def spectrum(self, wavenumber_per_m: Array) -> tuple[Array, Array]:
        """Response to a surface pressure of unit amplitude J0(kr).

        Returns the surface's sinking (K,) in m/Pa and the pressure under every layer (n,K), dimensionless.
        """
        k = np.asarray(wavenumber_per_m, dtype=float)
        stiffness = [_layer_stiffness(layer, k) for layer in self.layers]
        # Upward: the impedance of everything below each layer's top, and what reaches its bottom from its top.
        impedance: list[Array] = []
        passed: list[Array] = []
        for number in range(len(self.layers) - 1, -1, -1):
            top, across, bottom = stiffness[number]
            if not impedance:
                impedance.append(top)
                passed.append(np.zeros_like(top))
                continue
            gain = -_inverse(bottom + impedance[-1]) @ np.swapaxes(across, -1, -2)
            impedance.append(top + across @ gain)
            passed.append(gain)
        impedance, passed = impedance[::-1], passed[::-1]
        # Downward: displacements at the interfaces under a unit normal load.
        displacement = _inverse(impedance[0]) @ np.array([0.0, 1.0])
        sinking = displacement[:, 1]
        pressure = []
        for number in range(len(self.layers) - 1):
            displacement = (passed[number] @ displacement[..., None])[..., 0]
            pressure.append((impedance[number + 1] @ displacement[..., None])[:, 1, 0])
        # The rigid plate holds the lowest layer's bottom: its traction comes through the layer's cross stiffness.
        across = stiffness[-1][1]
        pressure.append(-(np.swapaxes(across, -1, -2) @ displacement[..., None])[:, 1, 0])
        return sinking, np.array(pressure)

    def point_pressure(self, radius_m: Array, interface: int) -> Array:
        """(...,) pressure under layer ``interface`` in Pa per newton of a point force, at radii (...,) in m."""
        depth_m = sum(layer.thickness_m for layer in self.layers[: interface + 1])
        k, weight = self._wavenumbers(_DECAYED / depth_m)
        amplitude = self.spectrum(k)[1][interface] * weight * k / (2 * np.pi)
        return self._superpose(radius_m, k, amplitude)

    def point_sinking(self, radius_m: Array) -> Array:
        """(...,) sinking of the surface in metre per newton of a point force, at radii > 0 in m; infinite at 0."""
        k, amplitude = self._layered_part()
        with np.errstate(divide="ignore"):
            half_space = self._half_space / np.asarray(radius_m, dtype=float)
        return half_space + self._superpose(radius_m, k, amplitude)

    def mean_sinking(self, offset_m: Array, disk_radius_m: float) -> Array:
        """(...,) sinking averaged over a disk, in m/N, of a point force at distances ``offset_m`` (...,) from its axis.

        The force must stand inside the disk. The half-space's part, 1/r, is integrated in closed form: 4 a E(s^2/a^2)
        over a disk of radius a for a point at s (E the complete elliptic integral of the second kind).
        """
        offset = np.asarray(offset_m, dtype=float)
        if np.any(offset > disk_radius_m):
            raise ValueError("the mean sinking is for forces inside the disk")
        half_space = self._half_space * 4 * ellipe((offset / disk_radius_m) ** 2) / (np.pi * disk_radius_m)
        k, amplitude = self._layered_part()
        x = k * disk_radius_m
        return half_space + self._superpose(offset, k, amplitude * 2 * j1(x) / x)

    @property
    def _half_space(self) -> float:
        """Boussinesq's r times sinking per newton, (1 - nu)/(2 pi mu), of a half-space of the top layer's material."""
        top = self.layers[0]
        return (1 - top.poissons_ratio**2) / (np.pi * top.youngs_modulus_pa)

    def _layered_part(self) -> tuple[Array, Array]:
        """Wavenumbers and weighted amplitudes of the surface's sinking less that of the half-space (smooth, short)."""
        k, weight = self._wavenumbers(0.5 * _DECAYED / self.layers[0].thickness_m)
        difference = self.spectrum(k)[0] - 2 * np.pi * self._half_space / k
        return k, difference * weight * k / (2 * np.pi)

    def _wavenumbers(self, largest_per_m: float) -> tuple[Array, Array]:
        """Nodes and weights of a composite Gauss rule: two panels per oscillation of J0 at the largest radius."""
        panels = max(40, int(np.ceil(largest_per_m * self.max_radius_m / np.pi)))
        edges = np.linspace(0.0, largest_per_m, panels + 1)
        node, weight = np.polynomial.legendre.leggauss(8)
        half = 0.5 * np.diff(edges)[:, None]
        middle = 0.5 * (edges[1:] + edges[:-1])[:, None]
        return (middle + half * node).ravel(), (half * weight).ravel()

    def _superpose(self, radius_m: Array, k: Array, amplitude: Array) -> Array:
        radius = np.asarray(radius_m, dtype=float)
        if np.any(radius > self.max_radius_m):
            raise ValueError(f"radius {radius.max():g} m beyond max_radius_m {self.max_radius_m:g} m")
        flat = radius.ravel()
        chunks = [j0(part[:, None] * k) @ amplitude for part in np.array_split(flat, max(1, flat.size // 512))]
        return np.concatenate(chunks).reshape(radius.shape)
