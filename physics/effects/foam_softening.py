"""The foam is stiffer the first time it is pressed (Mullins effect)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numba import njit

from ertskin.physics.effects.effect import Array, FoamEffect, Start, Strokes, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import STEPS, Standard


@dataclass(frozen=True)
class FoamSoftening(FoamEffect):
    """Force times 1 + excess v: v = 1 beyond the deepest sinking a place has seen, less where it has been before.

    Within the first press, unloading keeps the part ``kept`` of the excess (0: Mullins' softening at once, 1: the whole
    first cycle stays stiff). In the n-th press of the same place v is exp(-n/``presses``) at sinkings seen before.
    Softened foam comes back to the virgin curve as it nears its deepest sinking d: v is at least
    exp(-(1 - s/d)/``rejoin``); where ``rejoin`` is 0, all at once beyond d.
    """

    name: ClassVar[str] = "foam_softening"
    source: ClassVar[str] = "Mullins, Rubber Chem. Technol. 42 (1969) 339; Ogden & Roxburgh, Proc. R. Soc. A 455 (1999)"
    order: ClassVar[int] = 1
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.HISTORY, Axis.PLACE),
        (Signal.FORCE, Signal.COUPON),
        (Need.FORCES, Need.RELOADING),
        held=frozenset({"rejoin"}),
    )

    excess: float = parameter("1", 0.0, 3.0, 0.0, 0.05, "how much stiffer the virgin foam is")
    kept: float = parameter(
        "1", 0.0, 1.0, 1.0, 0.2, "part of the excess that lasts to the end of a press", defining=False
    )
    presses: float = parameter("1", 0.05, 50.0, 0.3, 0.3, "presses over which the excess fades", defining=False)
    rejoin: float = parameter(
        "1", 0.0, 3.0, 0.0, 0.2, "part of the deepest sinking over which it nears the virgin curve", defining=False
    )

    def reaction_n(self, force_n: Array, strokes: Strokes) -> Array:
        factor = _softened(
            strokes.sink_m,
            strokes.touched,
            strokes.place,
            strokes.press,
            self.excess,
            self.kept,
            self.presses,
            self.rejoin,
        )
        return np.asarray(force_n * factor)

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Part of the force, halfway in, that is gone in the third press of a place."""
        force = self.reaction_n(np.ones(3 * (2 * STEPS - 1)), standard.pressed_again(3)).reshape(3, -1)
        return {"softened_third_press": float(1 - force[2, STEPS // 2] / force[0, STEPS // 2])}

    @classmethod
    def force_starts(cls) -> tuple[Start, ...]:
        free = ("excess", "kept", "presses")
        return tuple(Start(cls(excess=0.1, kept=kept, presses=0.5), free) for kept in (0.5, 1.0))

    @classmethod
    def coupon_starts(cls) -> tuple[Start, ...]:
        """How fast it fades stays as it was found on other specimens: experiments/real/foam."""
        return (Start(cls(excess=0.3, kept=0.0, presses=0.05, rejoin=0.5), ("excess", "rejoin")),)


@njit(cache=True)
def _softened(sink, touched, place, press, excess, kept, presses, rejoin):  # type: ignore[no-untyped-def]
    factor = np.ones(len(sink))
    places = max(place.max() + 1, 1)
    deepest, earlier = np.zeros(places), np.zeros(places)
    count, current = np.full(places, -1), np.full(places, -1)
    for t in range(len(sink)):
        if not touched[t]:
            continue
        p = place[t]
        if current[p] != press[t]:
            count[p] += 1
            earlier[p] = deepest[p]
            current[p] = press[t]
        virgin = 1.0 if sink[t] > earlier[p] else np.exp(-count[p] / presses)
        unloading = earlier[p] < sink[t] < deepest[p]
        left = virgin * kept if unloading else virgin
        if rejoin > 0 and 0 < sink[t] <= deepest[p]:
            left = max(left, np.exp(-(1 - sink[t] / deepest[p]) / rejoin))
        factor[t] = 1 + excess * left
        deepest[p] = max(deepest[p], sink[t])
    return factor
