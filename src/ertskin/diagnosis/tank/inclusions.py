"""Where a tank or sheet changed between two scans: a map of its conductivity by iterated Gauss-Newton.

The unknown is the logarithm of the conductivity over the empty one's, so conductivities stay positive. Differences of
the two scans are fitted, so that systematic errors cancel. Total variation keeps edges (Rudin, Osher, Fatemi, Physica D
60 (1992) 259; lagged diffusivity, Vogel & Oman, SIAM J. Sci. Comput. 17 (1996) 227). How much of it: the least product
of misfit and variation along a path of weights (Reginska, SIAM J. Sci. Comput. 17 (1996) 740), which is where the
L-curve bends; nothing but the readings is asked.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csr_array, diags_array, vstack

from ertskin.diagnosis.linear.sensitivity import Hats, pairs_of_transfer, sheet_sensitivity
from ertskin.diagnosis.tank.electrode_error import unexplained_v
from ertskin.physics.calibration.contact_resistance import ContactFit, ContactProblem, robust
from ertskin.physics.calibration.scan_space import ScanSpace
from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution, SheetModel, Solution
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

NODES = 46
"""Grid nodes across the sheet's longer side."""
WEIGHTS = tuple(10.0**k for k in np.arange(2.0, -1.1, -0.5))
"""Weights of the total variation, from a map too smooth to one too rough; misfit counts in units of the noise."""
STEPS = 6
CONVERGED = 0.03
EDGE = 0.02
"""Differences between neighbouring nodes below this are smoothed rather than kept as edges."""
RIDGE = 1e-3
LARGEST_STEP = 1.0
ISOTROPIC = np.array([[1.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class InclusionMap:
    """The map on grid nodes (G,2): ``log_ratio`` (G,) of the conductivity to the empty sheet's.

    ``misfit``: chi-square of the reciprocal numbers fitted, under a ``weight`` of the map's ``variation``.
    """

    hats: Hats
    inside: NDArray[np.bool_]
    log_ratio: Array
    weight: float
    misfit: float
    variation: float

    def at(self, position_m: Array) -> Array:
        """(n,) log ratio at positions (n,2) in metre; NaN beyond the grid."""
        hats = self.hats.values(position_m)[self.inside]
        share = np.asarray(hats.sum(axis=0)).ravel()
        return np.asarray(np.where(share > 0.5, hats.T @ self.log_ratio / np.maximum(share, 1e-12), np.nan))


class Imaging:
    """Maps of one sheet against one empty scan (K,M) in volt: mesh, background, grid."""

    def __init__(self, sensor: Sensor, protocol: Protocol, empty_v: Array) -> None:
        """Raises ``RuntimeError`` where no background fits, ``MeshError`` where the sensor can't be meshed."""
        self.protocol, self.empty_v = protocol, empty_v
        side = float(np.ptp(sensor.extent_m, axis=0).max())
        self.model = SheetModel(sensor, Resolution(2, Grading(side / 40, side / 300, growth=4.0, spread=0.6)))
        guess = sensor.contact_resistance_guess_ohm
        problem = ContactProblem(self.model, protocol, empty_v, sensor.sheet_resistance_ohm_sq, guess, fit_sheet=True)
        self.background: ContactFit = robust(problem, rounds=2)
        first, last = sensor.extent_m
        self.hats = Hats(first, last, side / (NODES - 1))
        every = self.hats.values(self.model.quadrature_m.reshape(-1, 2))
        self.inside = np.asarray(every.sum(axis=1)).ravel() > 1e-9
        self.gather: csr_array = every[self.inside]
        self.slopes = _cell_differences(self.inside.reshape(len(self.hats.axes[1]), len(self.hats.axes[0])))
        self.pairs_of_transfer = pairs_of_transfer(protocol.electrodes).T

    @cached_property
    def empty(self) -> Solution:
        """The empty sheet's solution."""
        return self.solve(np.zeros(int(self.inside.sum())))

    def solve(self, log_ratio: Array) -> Solution:
        """The sheet with a map's conductivity."""
        ratio = np.exp(self.gather.T @ log_ratio).reshape(self.model.weight_m2.shape)
        return self.model.solve(ratio / self.background.sheet_resistance_ohm_sq, self.background.contact_resistance_ohm)

    def image(self, voltage_v: Array, variance_v2: Array | None = None) -> InclusionMap:
        """What changed between the empty scan and another one (K,M) in volt: where the L-curve bends first."""
        return bend(self.path(voltage_v, variance_v2))

    def path(self, voltage_v: Array, variance_v2: Array | None = None) -> Iterator[InclusionMap]:
        """Maps for every one of ``WEIGHTS``; ``variance_v2`` (K,M) of the readings, by default ``reading_variance``."""
        change = voltage_v - self.empty_v
        variance = reading_variance(self.protocol, change) if variance_v2 is None else variance_v2
        space = ScanSpace.of(self.protocol, 1.0 / variance)
        measured, transfer = space.coordinates(change), space.design @ self.pairs_of_transfer
        log_ratio = np.zeros(int(self.inside.sum()))
        for weight in WEIGHTS:
            for _ in range(STEPS):
                solution = self.solve(log_ratio)
                residual = measured - space.design @ self._change_ohm(solution)
                step = self._step(log_ratio, solution, residual, transfer, weight)
                log_ratio = log_ratio + step * min(1.0, LARGEST_STEP / float(np.abs(step).max()))
                if np.abs(step).max() < CONVERGED:
                    break
            residual = measured - space.design @ self._change_ohm(self.solve(log_ratio))
            misfit, variation = float(residual @ residual), float(self._variation(log_ratio).sum())
            yield InclusionMap(self.hats, self.inside, log_ratio, weight, misfit, variation)

    def jacobian(self, solution: Solution, transfer: Array) -> Array:
        """(n,G) by the log ratio, of coordinates whose derivatives by the transfer matrix's lower triangle (n,·) are
        ``transfer``."""
        elements = np.arange(len(self.model.weight_m2))
        conductivity = solution.conductivity_s.ravel()
        found = sheet_sensitivity(solution, elements, self.gather, transfer, ISOTROPIC, conductivity)[0]
        return found.astype(float)

    def _change_ohm(self, solution: Solution) -> Array:
        return solution.pair_resistance_ohm - self.empty.pair_resistance_ohm

    def _step(self, log_ratio: Array, solution: Solution, residual: Array, transfer: Array, weight: float) -> Array:
        """Gauss-Newton's step, the variation's edges as they are now."""
        jacobian = self.jacobian(solution, transfer)
        edges = 0.5 / np.sqrt(self._variation(log_ratio) ** 2 + EDGE**2)
        rough = self.slopes.T @ diags_array(np.tile(edges, 4)) @ self.slopes
        prior = weight * (rough.toarray() + RIDGE * np.eye(len(log_ratio)))
        gradient = jacobian.T @ residual - prior @ log_ratio
        return np.asarray(cho_solve(cho_factor(jacobian.T @ jacobian + prior), gradient))

    def _variation(self, log_ratio: Array) -> Array:
        """(C,) length of the map's gradient in every cell of the grid, per spacing."""
        return np.asarray(np.sqrt(0.5 * ((self.slopes @ log_ratio).reshape(4, -1) ** 2).sum(axis=0)))


def bend(path: Iterable[InclusionMap]) -> InclusionMap:
    """Of maps ever rougher, the one where the L-curve bends: the product of misfit and variation is least.

    From an empty map the product rises first; from where it falls on, its first minimum counts. Without one nothing
    but noise is seen, and the smoothest map is the answer.
    """
    maps = iter(path)
    first = best = next(maps)
    fell = False
    for one in maps:
        falls = one.misfit * one.variation < best.misfit * best.variation
        if fell and not falls:
            return best
        best, fell = one, falls
    return best if fell else first


def reading_variance(protocol: Protocol, change_v: Array) -> Array:
    """(K,M) variance in volt² of a change of the readings: by column, from what no network explains of it."""
    left = unexplained_v(protocol, change_v)
    freedom = 1 - protocol.orthonormal.shape[1] / protocol.count
    column = (left**2).sum(axis=0) / np.maximum(protocol.taken.sum(axis=0), 1) / max(freedom, 1e-3)
    return np.broadcast_to(np.maximum(column, 1e-6 * np.median(change_v[protocol.taken] ** 2)), left.shape)


def _cell_differences(inside: NDArray[np.bool_]) -> csr_array:
    """(4C, G) differences along the four sides of each of the C cells whose corners are all ``inside`` (ny,nx)."""
    number = np.where(inside, np.cumsum(inside).reshape(inside.shape) - 1, -1)
    corner = [number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]]
    whole = np.all([c >= 0 for c in corner], axis=0)
    a, b, c, d = (k[whole] for k in corner)
    count, nodes = len(a), int(inside.sum())
    row = np.tile(np.arange(count), 2)
    value = np.repeat([-1.0, 1.0], count)
    sides = ((a, b), (c, d), (a, c), (b, d))
    return csr_array(vstack([csr_array((value, (row, np.concatenate(side))), shape=(count, nodes)) for side in sides]))
