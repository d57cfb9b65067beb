"""One electrode's contact resistance drifts with recording time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, ElectrodeEffect
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Measured, Need, Signal
from ertskin.physics.effects.standard import Standard

LEAST_OHM = 1e-3
"""What no path brings a contact below."""
LATER_S = 300.0
"""After how long the change that is stated is taken."""


@dataclass(frozen=True)
class ContactDrift(ElectrodeEffect):
    """Contact resistance of ``electrode`` through ``ohm`` at ``knot_s`` after the first frame, straight in between.

    ``ohm`` is added to the calibrated resistance. Not in the design's table: the bench's contacts do it, and left out
    it would be taken for a change of the sheet.
    """

    name: ClassVar[str] = "contact_drift"
    source: ClassVar[str] = "Stitched contacts wander by far more than the reading noise within a recording"
    form_error: ClassVar[float] = 0.4
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.ELECTRODE, Axis.TIME), (Signal.REST,), (Need.REST_FRAMES,), measured=Measured.CONTACT_PATH
    )

    electrode: int = 0
    knot_s: tuple[float, ...] = (0.0,)
    ohm: tuple[float, ...] = (0.0,)

    def contact_resistance_ohm(self, resistance_ohm: Array, pressure_pa: Array, time_s: Array) -> Array:
        drifted = resistance_ohm.copy()
        drifted[:, self.electrode] += np.interp(time_s, self.knot_s, self.ohm)
        return np.maximum(drifted, LEAST_OHM)

    def most_taken_ohm(self, electrodes: int) -> Array:
        taken = np.zeros(electrodes)
        taken[self.electrode] = max(0.0, -min(self.ohm))
        return taken

    def quantities(self, standard: Standard) -> dict[str, float]:
        """By how much the contact changes in five minutes, or as far as it was followed, as a share. The largest
        of several is stated."""
        if self.electrode >= len(standard.contact_ohm):
            return {}
        calibrated = np.tile(standard.contact_ohm, (2, 1))
        first, later = self.contact_resistance_ohm(calibrated, np.zeros_like(calibrated), np.array([0.0, LATER_S]))
        if first[self.electrode] <= LEAST_OHM:
            return {}
        return {"largest_share_300_s": float((later / first - 1)[self.electrode])}
