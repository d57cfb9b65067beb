"""The paper's mechanics (II-B): the layered pad in 8-node bricks, bottom fixed, pressed by point forces.

Bricks lie on a rectangular grid that may be graded. Conjugate gradients, preconditioned by the exact inverse of every
vertical column of nodes: the pad is thin and its layers thinner, so the stiff couplings run down the columns. The
interface pressure is not taken from the strains but from equilibrium: the nodal forces that the bricks under the
interface take up are those of a pressure, found through the interface's mass matrix; its integral is the applied force.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import solve_banded

from ertskin.physics.mechanics.brick_element import CORNERS, brick_stiffness
from ertskin.physics.sensor import Layer, Sensor

Array = NDArray[np.float64]

_GROWTH = 1.25


def graded_axis_m(spacing_m: float, core_m: float, end_m: float) -> Array:
    """(n,) nodes from 0: equal steps to ``core_m``, then steps growing by a quarter each until ``end_m`` is reached."""
    axis = list(np.arange(round(core_m / spacing_m) + 1) * spacing_m)
    step = spacing_m
    while axis[-1] < end_m * (1 - 1e-9):
        step *= _GROWTH
        axis.append(min(axis[-1] + step, end_m) if axis[-1] + 1.5 * step < end_m else end_m)
    return np.array(axis)


def rows_per_layer(layers: tuple[Layer, ...], spacing_m: float) -> tuple[int, ...]:
    """Bricks over each layer's thickness: none taller than ``spacing_m``."""
    return tuple(max(1, int(np.ceil(layer.thickness_m / spacing_m - 1e-9))) for layer in layers)


@dataclass(frozen=True, eq=False)
class BrickPad:
    """A layered pad in bricks; all lengths in metre, forces in newton, z downward from the surface.

    ``x_m`` (nx,) and ``y_m`` (ny,) are the grid lines, ``rows`` the bricks over each layer. Sides are free, except
    that ``mirror`` makes the planes x = x_m[0] and y = y_m[0] planes of symmetry: forces on them count half.
    """

    layers: tuple[Layer, ...]
    x_m: Array
    y_m: Array
    rows: tuple[int, ...]
    mirror: tuple[bool, bool] = (False, False)

    @cached_property
    def _row_layer(self) -> NDArray[np.intp]:
        return np.repeat(np.arange(len(self.layers)), self.rows)

    @cached_property
    def z_m(self) -> Array:
        """(nz,) depths of the nodes below the surface."""
        heights = np.repeat([layer.thickness_m / n for layer, n in zip(self.layers, self.rows, strict=True)], self.rows)
        return np.concatenate([[0.0], np.cumsum(heights)])

    @property
    def shape(self) -> tuple[int, int, int]:
        """(nx, ny, nz) nodes."""
        return len(self.x_m), len(self.y_m), len(self.z_m)

    @cached_property
    def _unknowns(self) -> NDArray[np.int32]:
        """(bricks, 24) numbers of the displacements of every brick's nodes."""
        nx, ny, nz = self.shape
        node = np.arange(nx * ny * nz, dtype=np.int32).reshape(self.shape)
        corners = [node[i : nx - 1 + i, j : ny - 1 + j, k : nz - 1 + k].ravel() for i, j, k in CORNERS]
        every = np.stack(corners, axis=1)[:, :, None] * 3 + np.arange(3)
        return every.reshape(-1, 24).astype(np.int32)

    @cached_property
    def _brick_stiffness(self) -> Array:
        sides = np.meshgrid(np.diff(self.x_m), np.diff(self.y_m), np.diff(self.z_m), indexing="ij")
        size = np.stack([side.ravel() for side in sides], axis=1)
        columns = (len(self.x_m) - 1) * (len(self.y_m) - 1)
        modulus = np.array([layer.youngs_modulus_pa for layer in self.layers])[self._row_layer]
        ratio = np.array([layer.poissons_ratio for layer in self.layers])[self._row_layer]
        return brick_stiffness(size, np.tile(modulus, columns), np.tile(ratio, columns))

    @cached_property
    def _free(self) -> NDArray[np.bool_]:
        """(unknowns,) all but the bottom's and the displacements across planes of symmetry."""
        free = np.ones((*self.shape, 3), dtype=bool)
        free[:, :, -1] = False
        if self.mirror[0]:
            free[0, :, :, 0] = False
        if self.mirror[1]:
            free[:, 0, :, 1] = False
        return free.ravel()

    @cached_property
    def _system(self) -> sparse.csr_array:
        """The stiffness matrix in N/m; held displacements have unit rows of their own."""
        unknowns = self._unknowns
        row = np.repeat(unknowns, 24, axis=1).ravel()
        column = np.tile(unknowns, (1, 24)).ravel()
        keep = self._free[row] & self._free[column]
        count = len(self._free)
        entries = (self._brick_stiffness.ravel()[keep], (row[keep], column[keep]))
        held = sparse.diags_array((~self._free).astype(float))
        return (sparse.coo_array(entries, shape=(count, count)) + held).tocsr()

    @cached_property
    def _column_inverse(self) -> Array:
        """(columns, 3 nz, 3 nz) inverses of the diagonal blocks of the columns of nodes."""
        nx, ny, nz = self.shape
        height = 3 * nz
        entries = self._system.tocoo()
        row, column = entries.coords
        inside = row // height == column // height
        block = np.zeros((nx * ny, height, height))
        block[row[inside] // height, row[inside] % height, column[inside] % height] = entries.data[inside]
        return np.asarray(np.linalg.inv(block), dtype=float)

    def loads_n(self, point_m: Array, force_n: Array) -> Array:
        """(unknowns,) nodal forces of downward point forces (n,) at surface points (n,2)."""
        loads = np.zeros((*self.shape, 3))
        for (px, py), force in zip(np.atleast_2d(point_m), np.atleast_1d(force_n), strict=True):
            i, wx = _bracket(self.x_m, px)
            j, wy = _bracket(self.y_m, py)
            loads[i : i + 2, j : j + 2, 0, 2] += force * np.multiply.outer([1 - wx, wx], [1 - wy, wy])
        return loads.ravel()

    def solve(self, loads_n: Array, tolerance: float = 1e-6) -> Array:
        """(nx,ny,nz,3) displacements in metre; raises ``RuntimeError`` if the iteration does not converge.

        ``tolerance`` bounds the preconditioned residual against that of the start.
        """
        system, inverse = self._system, self._column_inverse
        columns = inverse.shape[:2]
        residual = np.where(self._free, loads_n, 0.0)
        displacement = np.zeros_like(residual)
        direction = np.zeros_like(residual)
        previous, start = 1.0, 0.0
        for step in range(5000):
            preconditioned = (inverse @ residual.reshape(*columns, 1)).ravel()
            energy = float(residual @ preconditioned)
            start = start or energy
            if energy <= tolerance**2 * start:
                return displacement.reshape(*self.shape, 3)
            direction = preconditioned + (energy / previous if step else 0.0) * direction
            image = system @ direction
            length = energy / float(direction @ image)
            displacement += length * direction
            residual -= length * image
            previous = energy
        raise RuntimeError("the brick pad's conjugate gradients did not converge in 5000 steps")

    def nodal_forces_n(self, displacement_m: Array, interface: int) -> Array:
        """(nx,ny) downward nodal forces in newton that the bricks under layer ``interface`` take up at their top."""
        below = np.tile(self._row_layer > interface, (len(self.x_m) - 1) * (len(self.y_m) - 1))
        unknowns = self._unknowns[below]
        brick = np.einsum("eij,ej->ei", self._brick_stiffness[below], displacement_m.ravel()[unknowns])
        total = np.zeros(displacement_m.size)
        np.add.at(total, unknowns.ravel(), brick.ravel())
        return total.reshape(displacement_m.shape)[:, :, sum(self.rows[: interface + 1]), 2]

    def interface_pressure(self, displacement_m: Array, interface: int) -> Array:
        """(nx,ny) nodal pressure in pascal under layer ``interface``, compression positive; not the lowest layer."""
        if not 0 <= interface < len(self.layers) - 1:
            raise ValueError("the interface must have a layer over and under it")
        forces = self.nodal_forces_n(displacement_m, interface)
        return _mass_solve(self.y_m, _mass_solve(self.x_m, forces).T).T

    def mean_sinking_m(self, displacement_m: Array, centre_m: Array, radius_m: float) -> float:
        """Surface sinking in metre averaged over a disk, which may reach across planes of symmetry."""
        radial, weight = np.polynomial.legendre.leggauss(24)
        share = 0.5 * (radial + 1)
        angle = np.arange(64) * 2 * np.pi / 64
        offset = radius_m * np.sqrt(share)[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        point = np.asarray(centre_m, dtype=float) + offset
        x = np.abs(point[..., 0] - self.x_m[0]) + self.x_m[0] if self.mirror[0] else point[..., 0]
        y = np.abs(point[..., 1] - self.y_m[0]) + self.y_m[0] if self.mirror[1] else point[..., 1]
        i, wx = _bracket(self.x_m, x)
        j, wy = _bracket(self.y_m, y)
        surface = displacement_m[:, :, 0, 2]
        value = (1 - wx) * ((1 - wy) * surface[i, j] + wy * surface[i, j + 1]) + wx * (
            (1 - wy) * surface[i + 1, j] + wy * surface[i + 1, j + 1]
        )
        return float(0.5 * weight @ value.mean(axis=1))


def quarter_pad(sensor: Sensor, spacing_m: float, core_m: float, end_m: float) -> BrickPad:
    """A quarter of a wide pad around the indenter's axis, which stands where the two planes of symmetry cross.

    Bricks of ``spacing_m`` to ``core_m`` from the axis, growing to ``end_m``; none in the layers is taller than
    four fifths of the spacing.
    """
    axis = graded_axis_m(spacing_m, core_m, end_m)
    return BrickPad(sensor.layers, axis, axis, rows_per_layer(sensor.layers, 0.8 * spacing_m), (True, True))


def _bracket(axis_m: Array, at_m: Array) -> tuple[NDArray[np.intp], Array]:
    """Number of the grid interval that holds each point, and the point's share of the way along it."""
    at = np.asarray(at_m, dtype=float)
    if np.any(at < axis_m[0] - 1e-12) or np.any(at > axis_m[-1] + 1e-12):
        raise ValueError(f"point outside the pad's grid [{axis_m[0]:g}, {axis_m[-1]:g}] m")
    number = np.clip(np.searchsorted(axis_m, at, side="right") - 1, 0, len(axis_m) - 2)
    return number, (at - axis_m[number]) / (axis_m[number + 1] - axis_m[number])


def _mass_solve(axis_m: Array, right: Array) -> Array:
    """Solve the mass matrix of linear elements on ``axis_m`` (n,) for right sides (n,m)."""
    step = np.diff(axis_m)
    band = np.zeros((3, len(axis_m)))
    band[0, 1:] = band[2, :-1] = step / 6
    band[1, :-1] += step / 3
    band[1, 1:] += step / 3
    return np.asarray(solve_banded((1, 1), band, right), dtype=float)
