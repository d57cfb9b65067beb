"""A specimen's test whose resistance spans decades: its law is free in logarithms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from ertskin.diagnosis.specimen.fit import SpecimenTest
from ertskin.physics.effects.effect import PiezoEffect
from ertskin.physics.effects.piezo_chain import felt

Array = NDArray[np.float64]

LAW_ORDER = 7
SMALLEST = 1e-3
"""Pressure over the largest, below which a specimen lies in the air."""

STRAIGHT = 0.85
"""Part of the law's coordinate from which to its end the slope is taken that goes on beyond."""


@dataclass(frozen=True, eq=False)
class LogarithmicTest(SpecimenTest):
    """A test whose law's logarithm is free in the pressure's, from ``SMALLEST`` of the largest on.

    ``fitted`` (N,): the readings that the law is fitted to. ``largest_pa``: the stress that the law's coordinate is
    counted from, the test's own largest where it is nought.
    """

    fitted: NDArray[np.bool_]
    largest_pa: float = 0.0

    @property
    def reach_pa(self) -> float:
        """Largest stress that the law's coordinate is counted from."""
        return self.largest_pa or float(self.stress_pa.max())

    def errors(self, effects: Sequence[PiezoEffect]) -> Array:
        """(N,) relative errors of all readings with these effects."""
        pressure, factor = self._felt(effects)
        return np.asarray(self.law(effects)(pressure) + factor - np.log(self.resistance_ohm_sq))

    def law(self, effects: Sequence[PiezoEffect]) -> Callable[[Array], Array]:
        """Log resistance over pressure in pascal, fitted with these effects; straight beyond the pressures fitted."""
        pressure, factor = self._felt(effects)
        known = self._coordinate(pressure[self.fitted])
        largest = known.max()

        def design(coordinate: Array) -> Array:
            return np.asarray(chebyshev.chebvander(2 * coordinate / largest - 1, LAW_ORDER))

        target = np.log(self.resistance_ohm_sq[self.fitted]) - factor[self.fitted]
        weight = np.linalg.lstsq(design(known), target, rcond=None)[0]
        end = design(np.array([STRAIGHT * largest, largest])) @ weight
        slope = (end[1] - end[0]) / ((1 - STRAIGHT) * largest)

        def at(pressure_pa: Array) -> Array:
            coordinate = self._coordinate(pressure_pa)
            beyond = np.maximum(coordinate - largest, 0.0)
            return np.asarray(design(np.minimum(coordinate, largest)) @ weight + slope * beyond)

        return at

    def residual(self, effects: Sequence[PiezoEffect]) -> Array:
        """(n,) those of the readings fitted."""
        return self.errors(effects)[self.fitted]

    def _felt(self, effects: Sequence[PiezoEffect]) -> tuple[Array, Array]:
        """(N,) pressure in pascal that the law answers to, and the logarithm of the factor on its resistance."""
        pressure, factor = felt(effects, self.stress_pa[:, None], np.zeros((1, 2)), self.time_s, np.zeros((2, 2)))
        return pressure[:, 0], np.log(np.broadcast_to(np.ravel(factor), self.stress_pa.shape))

    def _coordinate(self, pressure_pa: Array) -> Array:
        return np.asarray(np.log1p(np.maximum(pressure_pa, 0.0) / (SMALLEST * self.reach_pa)))
