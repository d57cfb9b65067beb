"""A sheet that drifts as a whole while its contacts stay."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.conduction.sheet import Solution

Array = NDArray[np.float64]

STEP = 0.01
"""Between such changes of the sheet's logarithm, pair resistances go straight: their bend by the contacts' share makes
less than a ten-thousandth of a contact."""
FEW = 0.25
"""Part of the sheet's elements up to which two solutions in part are quicker than one of the whole: a press of 24 pads'
sheet changes 0.17 to 0.2 of them, which is 0.3 of the work."""
KEPT = 3
"""Solutions of the untouched sheet held at once, some 50 MB each on the fine mesh."""


@dataclass(eq=False)
class DriftedSheets:
    """The untouched sheet, a ``resting`` solution, with its contacts divided by drifts; solved when first asked for.

    A sheet resistance times f with contacts z is f times the original sheet with contacts z/f. Not for several threads.
    """

    resting: Solution
    kept: dict[int, Solution] = field(default_factory=dict)

    @classmethod
    def of(cls, resting: Solution, log_drift: Array) -> DriftedSheets | None:
        """None where drifts (T,) are so far apart that each is solved sooner by itself, or the sheet doesn't drift."""
        steps = np.unique(np.floor(log_drift / STEP))
        return cls(resting) if log_drift.any() and 4 * len(steps) <= len(log_drift) else None

    def mostly_untouched(self, conductance_s: Array) -> bool:
        """Whether few elements of a sheet (E,Q) differ from the untouched one."""
        return bool((conductance_s != self.resting.conductivity_s).any(axis=1).mean() < FEW)

    def pair_resistance_ohm(self, conductance_s: Array, log_drift: float) -> Array:
        """(P,) pair resistances of a sheet (E,Q) whose contacts are divided by a drift, straight between two steps'."""
        below = int(np.floor(log_drift / STEP))
        share = log_drift / STEP - below
        model = self.resting.model
        ends = [model.solve_again(conductance_s, self._at(below + k)).pair_resistance_ohm for k in (0, 1)]
        return np.asarray((1.0 - share) * ends[0] + share * ends[1])

    def _at(self, steps: int) -> Solution:
        if steps == 0:
            return self.resting
        if steps not in self.kept:
            if len(self.kept) >= KEPT:
                self.kept.pop(next(iter(self.kept)))
            contacts = self.resting.contact_resistance_ohm * np.exp(-STEP * steps)
            self.kept[steps] = self.resting.model.solve(self.resting.conductivity_s, contacts)
        return self.kept[steps]
