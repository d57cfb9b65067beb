"""Rate-independent loss of the foam: less force on the way out than on the way in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numba import njit

from ertskin.physics.effects.effect import Array, FoamEffect, Start, Strokes, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import STEPS, Standard

_CONTACT = 1e-12


@dataclass(frozen=True)
class FoamHysteresis(FoamEffect):
    """Force times 1 + loss z, z from +1 (loading) to -1 (unloading): a stop operator in the logarithm of the force.

    z changes by 2/``reversal`` per unit of the logarithm of the elastic force and starts at +1 with every touch.
    ``driven_by`` "sinking" puts the sinking in the force's place: walls that buckle and snap follow the strain.
    """

    name: ClassVar[str] = "foam_hysteresis"
    source: ClassVar[str] = "Visintin, Differential Models of Hysteresis (1994), ch. III: stop operator"
    order: ClassVar[int] = 2
    form_error: ClassVar[float] = 0.15
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.HISTORY,), (Signal.FORCE, Signal.COUPON), (Need.FORCES, Need.RELOADING)
    )

    loss: float = parameter("1", 0.0, 0.8, 0.0, 0.03, "half the loop's height over the mean force")
    reversal: float = parameter("1", 0.005, 5.0, 0.1, 0.05, "relative force over which it turns round", defining=False)

    driven_by: str = "force"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.driven_by not in ("force", "sinking"):
            raise ValueError(f"{self.name}.driven_by must be 'force' or 'sinking', not {self.driven_by!r}")

    def reaction_n(self, force_n: Array, strokes: Strokes) -> Array:
        drive = force_n if self.driven_by == "force" else strokes.sink_m / strokes.foam_m
        goes_on = strokes.touched.copy()
        goes_on[1:] &= strokes.touched[:-1] & (strokes.place[1:] == strokes.place[:-1])
        goes_on[:1] = False
        return force_n * (1 + self.loss * _stop(np.log(np.maximum(drive, _CONTACT)), goes_on, 2 / self.reversal))

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Work lost over work put in, down to the deepest press and back."""
        share = np.concatenate([np.linspace(0, 1, STEPS), np.linspace(1, 0, STEPS)[1:]])
        strokes = standard.sunk(share, np.arange(len(share), dtype=float))
        force = self.reaction_n(strokes.elastic_n, strokes)
        lost = np.trapezoid(force, strokes.sink_m)
        return {"loss_share": float(lost / np.trapezoid(force[:STEPS], strokes.sink_m[:STEPS]))}

    @classmethod
    def force_starts(cls) -> tuple[Start, ...]:
        # Where every step turns it right round, nothing tells how fast it turns: no descent comes back from there.
        every = tuple(cls.parameters())
        return Start(cls(loss=0.05, reversal=0.1), every), Start(cls(loss=0.01, reversal=0.4), every)

    @classmethod
    def coupon_starts(cls) -> tuple[Start, ...]:
        return (Start(cls(loss=0.05, reversal=1.0, driven_by="sinking"), tuple(cls.parameters())),)


@njit(cache=True)
def _stop(log_drive, goes_on, rate):  # type: ignore[no-untyped-def]
    side = np.ones(len(log_drive))
    for t in range(1, len(log_drive)):
        if goes_on[t]:
            moved = side[t - 1] + rate * (log_drive[t] - log_drive[t - 1])
            side[t] = min(max(moved, -1.0), 1.0)
    return side
