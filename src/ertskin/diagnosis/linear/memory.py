"""What a linearised skin computed last under the forces of one moment."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.effects.effect import Effect, FoamEffect, PlacementEffect
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]


@dataclass(eq=False)
class Memory:
    """What was computed last under the forces ``force_n`` (T,C): most parameters that a fit moves leave most of it as
    it is.

    ``pressures`` by points and frames, ``relative`` and ``change`` by patch; ``regime``: pressure field and mechanics
    that they belong to. ``still``: a skin and its scans (n,P).
    """

    force_n: Array
    regime: tuple[object, tuple[Effect, ...]] = (None, ())
    pressures: dict[tuple[bytes, bytes], Array] = field(default_factory=dict)
    relative: dict[int, tuple[object, Array]] = field(default_factory=dict)
    change: dict[int, tuple[object, NDArray[np.float32]]] = field(default_factory=dict)
    still: tuple[Skin, Array] | None = None

    def settle(self, skin: Skin) -> None:
        """Forget the pressures of another pressure field or other mechanics."""
        placement = tuple(e for e in skin.effects if isinstance(e, PlacementEffect | FoamEffect))
        if not (self.regime[0] is skin.pressure and self.regime[1] == placement):
            self.pressures, self.relative, self.change = {}, {}, {}
            self.regime = skin.pressure, placement
