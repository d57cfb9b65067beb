"""The foam is stiffer the first time it is pressed (Mullins effect)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numba import njit
from scipy.special import erf

from ertskin.physics.effects.effect import Array, FoamEffect, Start, Strokes, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import STEPS, Standard

HELD_M = 1e-8
"""Below the deepest a press has been, by less than this, it is held and not let go."""


@dataclass(frozen=True)
class FoamSoftening(FoamEffect):
    """Force times 1 + excess v: v = 1 beyond the deepest sinking a place has seen, less where it has been before.

    Within the first press, unloading keeps the part ``kept`` of the excess (0: Mullins' softening at once, 1: the whole
    first cycle stays stiff). In the n-th press of the same place v is exp(-n/``presses``) at sinkings seen before.
    Softened foam comes back to the virgin curve as it nears its deepest sinking d: v is at least
    exp(-(1 - s/d)/``rejoin``); where ``rejoin`` is 0, all at once beyond d.

    With u = (s/h)^2, the energy at sinking s over that at the foam's thickness h, and ``scale`` m: ``driven_by``
    "energy" makes v = 1 - erf((U - u)/m), U the most that earlier presses of the place, in the part 1 - ``kept`` this
    one too, have put in (Ogden and Roxburgh); "work" makes v = exp(-A/m), A all the u ever put in on ways in (Miehe).
    """

    name: ClassVar[str] = "foam_softening"
    source: ClassVar[str] = (
        "Mullins, Rubber Chem. Technol. 42 (1969) 339; Ogden & Roxburgh, Proc. R. Soc. A 455 (1999); "
        "Miehe, Eur. J. Mech. A 14 (1995) 697: continuous damage"
    )
    order: ClassVar[int] = 1
    form_error: ClassVar[float] = 0.16
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.HISTORY, Axis.PLACE),
        (Signal.FORCE, Signal.COUPON),
        (Need.FORCES, Need.RELOADING),
        held=frozenset({"rejoin", "scale"}),
    )

    excess: float = parameter("1", 0.0, 3.0, 0.0, 0.05, "how much stiffer the virgin foam is")
    kept: float = parameter(
        "1", 0.0, 1.0, 1.0, 0.2, "part of the excess that lasts to the end of a press", defining=False
    )
    presses: float = parameter("1", 0.05, 50.0, 0.3, 0.3, "presses over which the excess fades", defining=False)
    rejoin: float = parameter(
        "1", 0.0, 3.0, 0.0, 0.2, "part of the deepest sinking over which it nears the virgin curve", defining=False
    )
    scale: float = parameter(
        "1", 1e-6, 100.0, 0.02, 0.01, "energy or work that softens, over that at one thickness", defining=False
    )

    driven_by: str = "sinking"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.driven_by not in ("sinking", "energy", "work"):
            raise ValueError(f"{self.name}.driven_by must be 'sinking', 'energy' or 'work', not {self.driven_by!r}")

    def reaction_n(self, force_n: Array, strokes: Strokes) -> Array:
        where = strokes.touched, strokes.place, strokes.press
        if self.driven_by == "sinking":
            virgin = _virgin(strokes.sink_m, *where, self.kept, self.presses, self.rejoin)
            return np.asarray(force_n * (1 + self.excess * virgin))
        energy = (strokes.sink_m / strokes.foam_m) ** 2
        before, now, work = _put_in(energy, *where)
        if self.driven_by == "work":
            virgin = np.exp(-work / self.scale)
        else:
            softened = (erf(np.maximum(most - energy, 0.0) / self.scale) for most in (before, now))
            virgin = 1 - np.average(list(softened), axis=0, weights=(self.kept, 1 - self.kept))
        return np.asarray(force_n * (1 + self.excess * virgin))

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Part of the force, halfway in, that is gone in the third press of a place."""
        force = self.reaction_n(np.ones(3 * (2 * STEPS - 1)), standard.pressed_again(3)).reshape(3, -1)
        return {"softened_third_press": float(1 - force[2, STEPS // 2] / force[0, STEPS // 2])}

    @classmethod
    def force_starts(cls) -> tuple[Start, ...]:
        free = ("excess", "kept", "presses")
        deepest = tuple(Start(cls(excess=0.1, kept=kept, presses=0.5), free) for kept in (0.5, 1.0))
        energy = tuple(cls(excess=0.1, kept=kept, scale=0.05, driven_by="energy") for kept in (0.2, 0.9))
        work = tuple(cls(excess=0.1, scale=scale, driven_by="work") for scale in (0.1, 1.0))
        return (
            *deepest,
            *(Start(form, ("excess", "kept", "scale")) for form in energy),
            *(Start(form, ("excess", "scale")) for form in work),
        )

    @classmethod
    def coupon_starts(cls) -> tuple[Start, ...]:
        """How fast it fades stays as it was found on other specimens: experiments/real/foam."""
        return (Start(cls(excess=0.3, kept=0.0, presses=0.05, rejoin=0.5), ("excess", "rejoin")),)


@njit(cache=True)
def _virgin(sink, touched, place, press, kept, presses, rejoin):  # type: ignore[no-untyped-def]
    left = np.ones(len(sink))
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
        unloading = earlier[p] < sink[t] < deepest[p] - HELD_M
        left[t] = virgin * kept if unloading else virgin
        if rejoin > 0 and 0 < sink[t] <= deepest[p]:
            left[t] = max(left[t], np.exp(-(1 - sink[t] / deepest[p]) / rejoin))
        deepest[p] = max(deepest[p], sink[t])
    return left


@njit(cache=True)
def _put_in(energy, touched, place, press):  # type: ignore[no-untyped-def]
    """(T,) most energy that earlier presses of the place have put in, that all have so far, and all ever put in."""
    before, now, work = np.zeros(len(energy)), np.zeros(len(energy)), np.zeros(len(energy))
    places = max(place.max() + 1, 1)
    most, earlier, done, last = np.zeros(places), np.zeros(places), np.zeros(places), np.zeros(places)
    current = np.full(places, -1)
    for t in range(len(energy)):
        if not touched[t]:
            continue
        p = place[t]
        if current[p] != press[t]:
            earlier[p], last[p], current[p] = most[p], 0.0, press[t]
        most[p] = max(most[p], energy[t])
        done[p] += max(energy[t] - last[p], 0.0)
        last[p] = energy[t]
        before[t], now[t], work[t] = earlier[p], most[p], done[p]
    return before, now, work
