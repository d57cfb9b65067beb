"""The foam's force relaxes at constant depth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, FoamEffect, Start, Strokes, parameter
from ertskin.physics.effects.exponential_memory import relaxing
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import Standard

SPREAD = np.linspace(0.0, 1.0, 8)
"""Where in the decades the time constants lie."""


@dataclass(frozen=True)
class ViscoelasticFoam(FoamEffect):
    """Prony series on the elastic force: F = e + sum_i f_i (part of e not yet relaxed with time constant tau_i).

    ``fraction`` is relative to the fully relaxed force. With ``decades`` > 0 the first term is the mean of eight, their
    time constants evenly spread in the logarithm from ``time_s`` on over so many decades (Fung's quasi-linear
    viscoelasticity). The pad can't pull the indenter: a negative force is none.
    """

    name: ClassVar[str] = "viscoelastic_foam"
    source: ClassVar[str] = (
        "Simo, Comput. Methods Appl. Mech. Eng. 60 (1987) 153: quasi-linear relaxation, Prony series; "
        "Fung, Biomechanics (1981), section 7.6"
    )
    order: ClassVar[int] = 3
    form_error: ClassVar[float] = 0.35
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.HISTORY, Axis.TIME),
        (Signal.FORCE, Signal.COUPON),
        (Need.FORCES,),
        held=frozenset({"decades", "slow_fraction", "slow_time_s"}),
    )

    fraction: float = parameter("1", 0.0, 5.0, 0.0, 0.05, "relaxing force over the relaxed force")
    time_s: float = parameter("s", 0.05, 2000.0, 5.0, 1.0, "relaxation time", defining=False)
    decades: float = parameter("1", 0.0, 6.0, 0.0, 0.5, "decades of time constants", defining=False)
    slow_fraction: float = parameter("1", 0.0, 5.0, 0.0, 0.05, "the same, second term")
    slow_time_s: float = parameter("s", 1.0, 20000.0, 60.0, 10.0, "relaxation time of the second term", defining=False)

    remembers_air: bool = False
    """Whether what a press left behind goes on into the next; otherwise foam in the air has recovered."""

    def reaction_n(self, force_n: Array, strokes: Strokes) -> Array:
        force = force_n.copy()
        air = None if self.remembers_air else ~strokes.touched
        spread_s = self.time_s * 10 ** (self.decades * (SPREAD if self.decades > 0 else SPREAD[:1]))
        for fraction, constants_s in ((self.fraction, spread_s), (self.slow_fraction, np.array([self.slow_time_s]))):
            if fraction > 0:
                force += fraction * relaxing(force_n, strokes.time_s, constants_s, air)
        return np.maximum(force, 0.0)

    def quantities(self, standard: Standard) -> dict[str, float]:
        """What of the force of a step is lost 10 s after it."""
        strokes = standard.sunk(np.ones(2), np.array([0.0, 10.0]))
        step, later = self.reaction_n(strokes.elastic_n, strokes)
        return {"share_relaxed": float(1 - later / step)}

    @classmethod
    def force_starts(cls) -> tuple[Start, ...]:
        single, spread = ("fraction", "time_s"), cls(fraction=0.1, time_s=0.3, decades=3.0)
        return (
            *(Start(cls(fraction=0.1, time_s=time_s), single) for time_s in (2.0, 20.0)),
            *(Start(replace(spread, remembers_air=air), (*single, "decades")) for air in (False, True)),
        )

    @classmethod
    def coupon_starts(cls) -> tuple[Start, ...]:
        """One time constant, and two: a coupon's test is long enough for both."""
        one = cls(fraction=0.2, time_s=10.0, remembers_air=True)
        two = cls(fraction=0.2, time_s=10.0, slow_fraction=0.15, slow_time_s=1.0, remembers_air=True)
        return Start(one, ("fraction", "time_s")), Start(two, tuple(cls.parameters()))
