"""An electrode's contact resistance falls where it is pressed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, ElectrodeEffect, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

LEAST_OHM = 1e-2
"""What no pressure brings a contact below."""
STRAIGHT = 1e-6
"""Bend that is as good as none."""
BEGUN_PATHS, BEGUN_ORDER = 10.0, 2.0
"""Of a percolating contact, where its fits begin: the power of networks in three dimensions is 1.6 to 2."""


@dataclass(frozen=True)
class ContactPressureDependence(ElectrodeEffect):
    """Contact resistance over (1 + bend sensitivity q)^(1/bend), q the interface pressure at every spot of the contact.

    Where contacts are pressed ``evenly``, as under electrodes that are stiff, q is the mean over each.

    At ``bend`` 1 conductance grows in proportion to the load, at 2 with its root; towards 0 resistance falls
    exponentially. ``sensitivity_per_pa``, the relative fall at first, is neutral at 0. ``fixed_share`` of the
    resistance no load takes: that of the lead and of the current spreading in the pad.

    A contact of grains ``percolates``: of the paths through it the part p = 1 - exp(-sensitivity q) is closed, and its
    conductance is 1 + ``paths`` p^``order`` times that at rest. The power is Kirkpatrick's, how paths close is assumed.
    """

    name: ClassVar[str] = "contact_pressure_dependence"
    source: ClassVar[str] = (
        "Holm, Electric Contacts (1967): constriction resistance as a power of the load; S. Kirkpatrick, Rev. Mod."
        " Phys. 45 (1973) 574: conductance of a network as a power of the paths closed"
    )
    form_error: ClassVar[float] = 0.3
    by_pressure: ClassVar[bool] = True
    hypothesis: ClassVar[Hypothesis] = Hypothesis((Axis.ELECTRODE, Axis.FORCE), (Signal.READINGS,), (Need.PRESSES,))

    sensitivity_per_pa: float = parameter(
        "1/Pa", 0.0, 0.1, 0.0, 2e-5, "relative fall, or paths closed, per pressure at first"
    )
    bend: float = parameter("1", 0.0, 10.0, 1.0, 0.2, "one over the power of the load", defining=False)
    fixed_share: float = parameter("1", 0.0, 0.95, 0.0, 0.05, "part of the resistance no load takes", defining=False)
    paths: float = parameter(
        "1", 0.0, 1e3, 10.0, 1.0, "conductance that closed paths add, over that at rest", defining=False
    )
    order: float = parameter(
        "1", 1.0, 8.0, 2.0, 0.5, "power of the paths closed that conductance grows with", defining=False
    )
    percolates: bool = False
    evenly: bool = False
    """Whether the pressure on a contact is the same all over it."""

    def contact_resistance_ohm(self, resistance_ohm: Array, pressure_pa: Array, time_s: Array) -> Array:
        load = self.sensitivity_per_pa * np.maximum(pressure_pa, 0.0)
        pressed = self._pressed(load)
        kept = self.fixed_share + (1 - self.fixed_share) * pressed
        return np.asarray(np.maximum(resistance_ohm * kept, np.minimum(resistance_ohm, LEAST_OHM)))

    def _pressed(self, load: Array) -> Array:
        """Part that a ``load``, sensitivity times pressure, leaves of the resistance that falls."""
        if self.percolates:
            return np.asarray(1 / (1 + self.paths * (-np.expm1(-load)) ** self.order))
        return np.asarray(np.exp(-load) if self.bend < STRAIGHT else (1 + self.bend * load) ** (-1 / self.bend))

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Contact conductance at half the specimen's stress over that at rest, less one."""
        large = np.full((1, 1), 1e6)
        pressed = self.contact_resistance_ohm(large, np.full((1, 1), 0.5 * standard.largest_pa), np.zeros(1))
        return {"gain_at_half_span": float((large / pressed)[0, 0] - 1)}

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        """A contact can't get worse under pressure: each is screened as a whole."""
        return tuple(
            Start(cls(sensitivity_per_pa=s, evenly=evenly), ("sensitivity_per_pa", "bend"))
            for evenly in (False, True)
            for s in (2e-5, 3e-4, 3e-3)
        )

    def freer(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        """With a part that no load takes; percolating."""
        if self.percolates or self.sensitivity_per_pa == 0:
            return ()
        partly = Start(self.changed({"bend": 1.0, "fixed_share": 0.2}), (*free, "fixed_share"))
        return (self._percolating(),) if "fixed_share" in free else (partly, self._percolating())

    def _percolating(self) -> Start:
        """Paths that close about where the conductance would have doubled if no part were fixed."""
        bend = max(self.bend, STRAIGHT)
        doubled = (2**bend - 1) / bend / self.sensitivity_per_pa
        closing = -np.log1p(-(BEGUN_PATHS ** (-1 / BEGUN_ORDER))) / doubled
        form = {"sensitivity_per_pa": float(closing), "paths": BEGUN_PATHS, "order": BEGUN_ORDER, "percolates": True}
        return Start(self.changed(form | {"bend": 1.0, "fixed_share": 0.0}), ("sensitivity_per_pa", "paths", "order"))
