"""Rate-independent loss of the foam: less force on the way out than on the way in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.physics.effects.effect import Array, FoamEffect, Start, Strokes, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import STEPS, Standard

_CONTACT = 1e-12
DRIVES = "force", "sinking", "strain", "energy"
"""What the loss may be driven by."""


@dataclass(frozen=True)
class FoamHysteresis(FoamEffect):
    """Force times 1 + loss z, z from +1 (loading) to -1 (unloading): a stop operator in the logarithm of the force.

    z changes by 2/``reversal`` per unit of the logarithm of the elastic force and starts at +1 with every touch.
    ``driven_by`` "sinking" puts the sinking in the force's place: walls that buckle and snap follow the strain. By
    "strain" z begins at nought and nears the side it moves to, by a factor e for every change of the strain by
    ``slide``: solid friction. By "energy" z = 2 w^``shape`` - 1, w the elastic energy over the most since the touch.
    """

    name: ClassVar[str] = "foam_hysteresis"
    source: ClassVar[str] = (
        "Visintin, Differential Models of Hysteresis (1994), ch. III: stop operator; Dahl, AIAA J. 14 (1976) 1675 "
        "(Bouc and Wen's of order one); LS-DYNA Theory Manual, material 57: unloading factor"
    )
    order: ClassVar[int] = 2
    form_error: ClassVar[float] = 0.15
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.HISTORY,), (Signal.FORCE, Signal.COUPON), (Need.FORCES, Need.RELOADING)
    )

    loss: float = parameter("1", 0.0, 0.8, 0.0, 0.03, "half the loop's height over the mean force")
    reversal: float = parameter("1", 0.005, 5.0, 0.1, 0.05, "relative force over which it turns round", defining=False)

    slide: float = parameter("1", 0.005, 0.3, 0.1, 0.02, "strain over which it turns round, by strain", defining=False)
    shape: float = parameter("1", 0.1, 10.0, 1.0, 0.1, "power of the energy, by which it is driven", defining=False)

    driven_by: str = "force"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.driven_by not in DRIVES:
            raise ValueError(f"{self.name}.driven_by must be one of {', '.join(DRIVES)}, not {self.driven_by!r}")

    def reaction_n(self, force_n: Array, strokes: Strokes) -> Array:
        goes_on = strokes.touched.copy()
        goes_on[1:] &= strokes.touched[:-1] & (strokes.place[1:] == strokes.place[:-1])
        goes_on[:1] = False
        return force_n * (1 + self.loss * self._side(force_n, strokes, goes_on))

    def _side(self, force_n: Array, strokes: Strokes, goes_on: NDArray[np.bool_]) -> Array:
        """(T,) z, from -1 to 1; ``goes_on`` (T,) where a frame's touch is that of the frame before."""
        strain = strokes.sink_m / strokes.foam_m
        if self.driven_by == "strain":
            return np.asarray(_friction(strain, goes_on, self.slide))
        if self.driven_by == "energy":
            share = strain / np.maximum(_deepest(strain, goes_on), _CONTACT)
            return np.asarray(2 * share ** (2 * self.shape) - 1)
        drive = force_n if self.driven_by == "force" else strain
        return np.asarray(_stop(np.log(np.maximum(drive, _CONTACT)), goes_on, 2 / self.reversal))

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
        free = ("loss", "reversal")
        return (
            Start(cls(loss=0.05, reversal=0.1), free),
            Start(cls(loss=0.01, reversal=0.4), free),
            Start(cls(loss=0.03, driven_by="strain"), ("loss", "slide")),
            Start(cls(loss=0.03, driven_by="energy"), ("loss", "shape")),
        )

    @classmethod
    def coupon_starts(cls) -> tuple[Start, ...]:
        return (Start(cls(loss=0.05, reversal=1.0, driven_by="sinking"), ("loss", "reversal")),)


@njit(cache=True)
def _stop(log_drive, goes_on, rate):  # type: ignore[no-untyped-def]
    side = np.ones(len(log_drive))
    for t in range(1, len(log_drive)):
        if goes_on[t]:
            moved = side[t - 1] + rate * (log_drive[t] - log_drive[t - 1])
            side[t] = min(max(moved, -1.0), 1.0)
    return side


@njit(cache=True)
def _friction(strain, goes_on, slide):  # type: ignore[no-untyped-def]
    side, before, at = np.zeros(len(strain)), 0.0, 0.0
    for t in range(len(strain)):
        if not goes_on[t]:
            before, at = 0.0, 0.0
        way = strain[t] - at
        towards = 1.0 if way > 0 else -1.0
        before = towards + (before - towards) * np.exp(-abs(way) / slide)
        side[t], at = before, strain[t]
    return side


@njit(cache=True)
def _deepest(strain, goes_on):  # type: ignore[no-untyped-def]
    deepest = strain.copy()
    for t in range(1, len(strain)):
        if goes_on[t]:
            deepest[t] = max(deepest[t], deepest[t - 1])
    return deepest
