"""The conditions that effects state their quantities for, so that these mean the same whatever the effect's form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.effects.effect import Strokes
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

STEPS = 80
"""Of either branch of a cycle."""


@dataclass(frozen=True, eq=False)
class Standard:
    """What a recording sets: its fabric's law, its largest stress, its deepest press, its sheet; NaN where unknown.

    ``resistance`` gives the law's resistance, in any unit, over pressures (n,) in pascal; ``largest_pa`` is the largest
    stress of the specimen. ``point_m`` (n,2): the sensing points, ``extent_m`` (2,2) the sheet's box,
    ``pressed_m`` (m,2) the places pressed. ``step_m``: the step in depth between frames while a press moves, ``scan_s``
    how long a scan takes, ``contact_ohm`` (L,) the contact resistances,
    ``sensor`` the skin as drawn.
    """

    resistance: Callable[[Array], Array]
    largest_pa: float
    deepest_m: float = np.nan
    foam_m: float = np.nan
    step_m: float = np.nan
    scan_s: float = np.nan
    point_m: Array = field(default_factory=lambda: np.zeros((0, 2)))
    extent_m: Array = field(default_factory=lambda: np.zeros((2, 2)))
    pressed_m: Array = field(default_factory=lambda: np.zeros((0, 2)))
    contact_ohm: Array = field(default_factory=lambda: np.zeros(0))
    sensor: Sensor | None = None

    def cycle_pa(self, share: float) -> Array:
        """(2 STEPS - 1,) pressures up to a share of the largest stress and down again."""
        up = np.linspace(0.0, share * self.largest_pa, STEPS)
        return np.concatenate([up, up[-2::-1]])

    def hold(self, share: float, rise_s: float, hold_s: float) -> tuple[Array, Array]:
        """Times and pressures (n,) of a rise to a share of the largest stress and a hold; ten steps a second."""
        time_s = np.linspace(0.0, rise_s + hold_s, round(10 * (rise_s + hold_s)) + 1)
        return time_s, share * self.largest_pa * np.minimum(time_s / rise_s, 1.0)

    def sunk(self, share: Array, time_s: Array) -> Strokes:
        """The pad's top pressed in by a share (n,) of the deepest press, a linear pad of 1 N/m under it."""
        sink_m, one = share * self.deepest_m, np.ones(len(share))
        still = np.zeros(len(share), dtype=np.intp)
        return Strokes(sink_m, sink_m, time_s, one > 0, still, still.astype(np.int64), self.foam_m)

    def pressed_again(self, presses: int) -> Strokes:
        """One place pressed in to the deepest press and let go so often, one after the other."""
        down = np.linspace(0.0, self.deepest_m, STEPS)
        sink_m = np.tile(np.concatenate([down, down[-2::-1]]), presses)
        press = np.repeat(np.arange(presses), 2 * STEPS - 1)
        still = np.zeros(len(sink_m), dtype=np.intp)
        return Strokes(sink_m, sink_m, np.arange(len(sink_m), dtype=float), sink_m > 0, still, press, self.foam_m)
