"""Thousands of presses at a few places: fine where it matters, coarse where that is enough.

What one contact does to the pair resistances is a smooth function of its force; it is solved on the fine mesh, at a few
forces for every place, and interpolated. What several contacts do together beyond the sum of what each does alone is
small and smooth, and is taken from a coarser mesh, the coarser the farther they are apart:

    r(all) = r_coarse(all) + [r0 - r0_coarse] + sum_c [dr(c, f_c) - dr_coarse(c, f_c)].

One contact alone needs no solve at all. For two contacts near one another what this sum still lacks is solved at nine
pairs of forces and interpolated (``PairTable``). So can be all that two do together that are far from one another: of
the paper's 36 taxels 392 pairs are, and on the main job's skin that misses 0.02 of the noise (mean over the numbers,
0.07 in the worst of 240 trials). Against the fine mesh solved in full, on the paper's sheet and pad and 2 mV of noise
at 0.1 mA, all is within a tenth of the noise in the 276 numbers: 0.04 for neighbours at 10 N each, the hardest there
are; a fifth of that in the readings. A law with a kink leaves more, as it does on the mesh itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline

from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.pair_table import PairTable
from ertskin.physics.conduction.pressed_sheet import PiezoLaw, PressedSheet, UnitPressure, in_chunks
from ertskin.physics.conduction.sheet import Resolution, SheetModel
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SAME_PLACE_M = 1e-9
APART_M = 0.05
NEAR_M = 0.042
"""Contacts nearer than this need more than a coarse mesh and a pressure cut off at 2e-4 of its peak tell."""
FAR = Resolution(1, Grading(cell_m=3e-3, rim_m=1e-3, growth=4.0, spread=0.7))
"""For what contacts farther apart than ``APART_M`` do together."""


class Rest(Protocol):
    """The untouched sheet."""

    @property
    def pair_resistance_ohm(self) -> Array:
        """(pairs,) ohm."""


class Pressed(Protocol):
    """A sheet that can be pressed: a ``PressedSheet``, or a whole skin whose presses don't depend on one another."""

    @property
    def rest(self) -> Rest:
        """The sheet without any contact."""

    def pair_resistances(self, contact_m: Array, force_n: Array, workers: int = 1) -> Array:
        """(N,pairs) ohm under contacts (N,P,2) with forces (N,P); NaN for an absent contact."""


@dataclass(frozen=True, eq=False)
class Level:
    """A coarse sheet for contacts at least ``apart_m`` from one another; where ``tabulated`` it is solved for pairs of
    places at nine pairs of forces, and not for each trial of two contacts."""

    apart_m: float
    sheet: Pressed
    tabulated: bool = False


class TrialSolver:
    """Pair resistances of any number of contacts at prepared ``places_m`` (C,2) with forces up to ``max_force_n``.

    ``fine`` decides the accuracy; ``levels`` from the nearest to the farthest, the first for contacts at any distance.
    ``forces``: forces solved for each place. Pairs of places nearer than ``near_m`` are solved on ``fine`` too.
    """

    def __init__(
        self,
        fine: Pressed,
        levels: Sequence[Level],
        places_m: Array,
        max_force_n: float,
        forces: int = 16,
        workers: int = 1,
        near_m: float = 0.0,
    ) -> None:
        if levels[0].apart_m > 0:
            raise ValueError("the first level must serve contacts at any distance")
        self.levels = list(levels)
        self.places_m = np.asarray(places_m, dtype=float)
        self.max_force_n = max_force_n
        self._force_n = max_force_n * (np.arange(1, forces + 1) / forces) ** 1.5
        self._rest = fine.rest.pair_resistance_ohm
        self._alone = self._responses(fine, workers)
        self._alone_at = [
            self._alone if level.sheet is fine else self._responses(level.sheet, workers) for level in levels
        ]
        self._tables: dict[int, PairTable] = {}

        def lacking(contact_m: Array, force_n: Array) -> Array:
            assembled = self._assembled(contact_m, force_n, self._placed(contact_m, force_n), workers)
            return fine.pair_resistances(contact_m, force_n, workers) - assembled

        self._near = PairTable(lacking, self.places_m, max_force_n, most_m=near_m)

    @classmethod
    def of(
        cls,
        sensor: Sensor,
        pressure: UnitPressure,
        law: PiezoLaw,
        contact_resistance_ohm: Array,
        places_m: Array,
        max_force_n: float,
        workers: int = 1,
        resolution: str | Resolution = "fine",
    ) -> TrialSolver:
        """As exact as ``resolution``, by coarse meshes for contacts nearer and farther than 50 mm from one another."""

        def pressed(chosen: str | Resolution, tail: float) -> PressedSheet:
            sheet = PressedSheet(SheetModel(sensor, chosen), pressure, law, contact_resistance_ohm, tail)
            sheet.remember(places_m)
            return sheet

        levels = [Level(0.0, pressed("fast", 2e-4)), Level(APART_M, pressed(FAR, 2e-4))]
        return cls(pressed(resolution, 5e-6), levels, places_m, max_force_n, workers=workers, near_m=NEAR_M)

    def covers(self, contact_m: Array, force_n: Array) -> NDArray[np.bool_]:
        """(N,) whether all contacts of a trial lie at prepared places, with forces no larger than prepared."""
        present = np.isfinite(contact_m).all(axis=2) & (np.nan_to_num(force_n) > 0)
        placed = self._distance2(contact_m).min(axis=2) < SAME_PLACE_M**2
        return ((placed & (np.nan_to_num(force_n) <= self.max_force_n)) | ~present).all(axis=1)

    def pair_resistances(self, contact_m: Array, force_n: Array, workers: int = 1) -> Array:
        """(N,pairs) ohm under contacts (N,P,2) with forces (N,P) in newton; NaN for an absent contact.

        The same whatever the number of workers (threads). Raises ``ValueError`` for a place that wasn't prepared or a
        force beyond ``max_force_n``.
        """
        place = self._placed(contact_m, force_n)
        assembled = self._assembled(contact_m, force_n, place, workers)
        return assembled + self._near.of(place, force_n)

    def _assembled(self, contact_m: Array, force_n: Array, place: Indices, workers: int) -> Array:
        """The sum at the head of this file."""
        force = np.where(place >= 0, force_n, 0.0)
        chosen = self._level(contact_m, place)
        pair = (place >= 0).sum(axis=1) == 2
        total = self._rest + self._interpolated(self._alone, place, force)
        for number, level in enumerate(self.levels):
            known = (chosen == number) & pair & level.tabulated
            if known.any():
                self.tabulate(workers)
                total[known] += self._tables[number].of(place[known], force[known])
            rows = np.flatnonzero((chosen == number) & ~known)
            if len(rows):
                total[rows] += self._together(number, contact_m[rows], force_n[rows], place[rows], workers)
        return total

    def _together(self, number: int, contact_m: Array, force_n: Array, place: Indices, workers: int) -> Array:
        """(N,pairs) ohm that contacts add to the sum of what each does alone, on the mesh of a level."""
        sheet = self.levels[number].sheet
        solved = in_chunks(lambda part: sheet.pair_resistances(contact_m[part], force_n[part]), len(place), workers)
        alone = self._interpolated(self._alone_at[number], place, np.where(place >= 0, force_n, 0.0))
        return np.concatenate(solved) - sheet.rest.pair_resistance_ohm - alone

    def tabulate(self, workers: int = 1) -> None:
        """Solve what two contacts do together at the levels that are to be tabulated, unless that is done; the first
        trials that need it do so too."""
        for number, level in enumerate(self.levels):
            if level.tabulated and number not in self._tables:
                farther = [other.apart_m for other in self.levels[number + 1 :]]
                together = partial(self._pairs_together, number, workers)
                table = PairTable(together, self.places_m, self.max_force_n, level.apart_m, *farther[:1])
                self._tables[number] = table

    def _pairs_together(self, number: int, workers: int, contact_m: Array, force_n: Array) -> Array:
        """As ``_together``, of contacts (N,2,2) with forces (N,2)."""
        return self._together(number, contact_m, force_n, self._placed(contact_m, force_n), workers)

    def _responses(self, sheet: Pressed, workers: int) -> list[BSpline]:
        """For each place, the change of the pair resistances against force."""
        contact = np.repeat(self.places_m, len(self._force_n), axis=0)[:, None]
        force = np.tile(self._force_n, len(self.places_m))[:, None]
        change = sheet.pair_resistances(contact, force, workers) - sheet.rest.pair_resistance_ohm
        nodes = np.concatenate([[0.0], self._force_n])
        each = change.reshape(len(self.places_m), len(self._force_n), -1)
        return [make_interp_spline(nodes, np.concatenate([np.zeros((1, each.shape[2])), one]), k=3) for one in each]

    def _placed(self, contact_m: Array, force_n: Array) -> Indices:
        """(N,P) number of each contact's place, -1 for an absent one."""
        if not self.covers(contact_m, force_n).all():
            raise ValueError(f"a contact lies at a place that wasn't prepared, or presses beyond {self.max_force_n} N")
        present = np.isfinite(contact_m).all(axis=2) & (np.nan_to_num(force_n) > 0)
        return np.where(present, self._distance2(contact_m).argmin(axis=2), -1)

    def _distance2(self, contact_m: Array) -> Array:
        """(N,P,C) squared distance of contacts from the prepared places."""
        return ((np.nan_to_num(contact_m)[:, :, None] - self.places_m) ** 2).sum(axis=3)

    def _level(self, contact_m: Array, place: Indices) -> Indices:
        """(N,) level for each trial, -1 where one contact or none is present."""
        apart = np.full(len(place), np.inf)
        for i in range(place.shape[1]):
            for j in range(i):
                both = (place[:, i] >= 0) & (place[:, j] >= 0)
                gap = np.hypot(*(contact_m[both, i] - contact_m[both, j]).T)
                apart[both] = np.minimum(apart[both], gap)
        floor = np.array([level.apart_m for level in self.levels])
        number = np.searchsorted(floor, apart, side="right") - 1
        return np.where((place >= 0).sum(axis=1) > 1, number, -1)

    def _interpolated(self, table: list[BSpline], place: Indices, force_n: Array) -> Array:
        """(N,pairs) sum over the contacts of their interpolated responses."""
        total = np.zeros((len(place), table[0].c.shape[1]))
        for column in range(place.shape[1]):
            for number, response in enumerate(table):
                rows = np.flatnonzero(place[:, column] == number)
                if len(rows):
                    total[rows] += response(force_n[rows, column])
        return total
