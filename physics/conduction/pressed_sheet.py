"""The sheet under indenters at given places with given forces: one solve a press, only where it presses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.conduction.sheet import SheetModel, Solution, transfer_of
from ertskin.physics.protocol import pair_resistances

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

CHUNK_PRESSES = 64  # presses a worker takes at once


class UnitPressure(Protocol):
    """The interface pressure of one indenter, as ``ertskin.physics.mechanics.pressure.InterfacePressure`` has it."""

    def at(self, offset_m: Array) -> Array:
        """(...,) pascal per newton at offsets (...,2) from the indenter's axis."""

    def radius_m(self, fraction: float) -> float:
        """Distance beyond which the pressure stays below a fraction of its largest value."""


class PiezoLaw(Protocol):
    """Sheet resistance against pressure, as ``ertskin.physics.piezo.polynomial.PiezoPolynomial`` has it."""

    def sheet_resistance_ohm_sq(self, pressure_pa: Array) -> Array:
        """(...,) ohm per square at pressures (...,)."""


class PressedSheet:
    """One sheet model with its law, its contact resistances (L,) in ohm, and the pressure of one indenter.

    Pressure below ``tail`` of its largest value is left out; with 0 none is, and the whole sheet is solved every time.
    On the paper's pad, at 10 N, a tail of 2e-5 changes the 276 numbers by 0.06 of a 2 mV noise, 2e-4 by half of it.
    """

    def __init__(
        self,
        sheet: SheetModel,
        pressure: UnitPressure,
        law: PiezoLaw,
        contact_resistance_ohm: Array,
        tail: float = 2e-5,
    ) -> None:
        self.sheet = sheet
        self.pressure = pressure
        self.law = law
        self.reach_m = pressure.radius_m(tail) if tail > 0 else np.inf
        resting = np.zeros(sheet.weight_m2.shape)
        self.rest = sheet.solve(1.0 / law.sheet_resistance_ohm_sq(resting), contact_resistance_ohm)
        self._spots: dict[tuple[float, float], tuple[Indices, Array]] = {}

    def remember(self, contact_m: Array) -> None:
        """Keep the pressure fields of contacts at positions (n,2) that will come again."""
        for place in contact_m:
            self._spots[float(place[0]), float(place[1])] = self._spot(place)

    def solve(self, contact_m: Array, force_n: Array) -> Solution:
        """The sheet under contacts (P,2) with forces (P,); a contact whose place or force is NaN is absent."""
        present = np.isfinite(contact_m).all(axis=1) & (np.nan_to_num(force_n) > 0)
        if not present.any():
            return self.rest
        spots = [self._spot(place) for place in contact_m[present]]
        reached = np.zeros(len(self.sheet.weight_m2), dtype=bool)
        for where, _ in spots:
            reached[where] = True
        elements = np.flatnonzero(reached)
        pressure = np.zeros((len(elements), self.sheet.weight_m2.shape[1]))
        for (where, unit), force in zip(spots, force_n[present], strict=True):
            pressure[np.searchsorted(elements, where)] += force * unit
        conductivity = 1.0 / self.law.sheet_resistance_ohm_sq(pressure)
        if len(elements) == len(self.sheet.weight_m2):
            return self.sheet.solve(conductivity, self.rest.contact_resistance_ohm)
        return self.sheet.solve_part(elements, conductivity, self.rest)

    def pair_resistances(self, contact_m: Array, force_n: Array, workers: int = 1) -> Array:
        """(N,pairs) ohm under contacts (N,P,2) with forces (N,P); the same whatever the number of workers (threads)."""

        def some(rows: slice) -> Array:
            presses = zip(contact_m[rows], force_n[rows], strict=True)
            conductance = np.array([self.solve(contact, force).conductance_s for contact, force in presses])
            return pair_resistances(transfer_of(conductance))

        if not len(contact_m):
            return np.zeros((0, len(self.rest.pair_resistance_ohm)))
        return np.concatenate(in_chunks(some, len(contact_m), workers))

    def _spot(self, place_m: Array) -> tuple[Indices, Array]:
        """Elements (n,) within reach of a contact, and the pressure per newton (n,Q) there."""
        key = float(place_m[0]), float(place_m[1])
        if key in self._spots:
            return self._spots[key]
        offset = self.sheet.quadrature_m - place_m
        within = (offset**2).sum(axis=2) < self.reach_m**2
        elements = np.flatnonzero(within.any(axis=1))
        return elements, np.where(within[elements], self.pressure.at(offset[elements]), 0.0)


def in_chunks(job: Callable[[slice], Array], rows: int, workers: int) -> Sequence[Array]:
    """Results of a job over slices of ``rows``, in order, on a number of threads (the solver leaves Python's lock)."""
    slices = [slice(first, min(first + CHUNK_PRESSES, rows)) for first in range(0, rows, CHUNK_PRESSES)]
    if workers == 1:
        return [job(part) for part in slices]
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(job, slices))
