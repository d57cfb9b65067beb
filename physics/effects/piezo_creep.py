"""The fabric's resistance drifts at constant pressure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.effects.contact_age import contact_age_s
from ertskin.physics.effects.effect import Array, PiezoEffect, Start, parameter
from ertskin.physics.effects.exponential_memory import lagging, moves_within_s
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.effects.touching import touching_share
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

STEPS = np.linspace(0.0, 1.0, 6)
AGREED_PA = 1e4
SAME = 1e-6
"""Below it ``power`` is as good as none."""
LEAST_LEFT = 1e-3
"""Part of the resistance that no creep takes away."""
RISE_S, HOLD_S = 2.0, 10.0
"""Of the press that states how much creeps."""
MOST_PASSED = 0.8
"""Part of a static law that faster creep makes up at most."""
AGED = 0.03
"""What is lost of the logarithm of the resistance as contacts grow older by a factor e, where a fit of that begins."""


@dataclass(frozen=True)
class PiezoCreep(PiezoEffect):
    """The fabrics settle into one another: the resistance goes on falling under a pressure that stays.

    The law answers to p + fraction m, m following p with time constant tau; a press leaves for the air, or comes from
    there, no slower than most frames follow one another. With ``decades`` > 0 it is the mean of six
    such m, their time constants evenly spread in the logarithm from ``time_s`` on over so many decades: fabrics creep
    with the logarithm of time. They need not creep in proportion to the pressure: m follows p to the power
    ``exponent``, scaled to agree with p at ``AGREED_PA``.

    Where it ``multiplies``, the law's resistance is multiplied by exp(-fraction m), m following 1 - 2^(-p/half_pa):
    spots in contact grow, and gaps of exponentially distributed widths leave ever fewer to close. One over the mean of
    these widths may differ over the fabric: with ``unevenness`` u > 0, its variance over its mean square in a gamma
    distribution, m follows 1 - (1 + (2^u - 1) p/half_pa)^(-1/u), at u = 1 p/(p + half_pa). With ``power`` a the a-th
    power of the resistance falls in proportion to m instead of its logarithm: at 1 the resistance, at -1 the
    conductance grows. Where it ``ages`` too, m doesn't follow but is that share of the gaps times ln(1 + age/tau): the
    longer contacts have stayed the better they conduct, and a relative change of the pressure by ``slip`` renews most.
    """

    name: ClassVar[str] = "piezo_creep"
    source: ClassVar[str] = (
        "Standard linear solid in compliance; FSR drift, Hollinger & Wanderley (NIME 2006); Nutting (1921); "
        "gaps as in Greenwood & Williamson, Proc. R. Soc. A 295 (1966) 300; ageing as in Dieterich (1972), Ruina (1983)"
    )
    order: ClassVar[int] = 3
    form_error: ClassVar[float] = 0.2
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.HISTORY, Axis.TIME), (Signal.READINGS, Signal.SPECIMEN), (Need.PRESSES,)
    )

    fraction: float = parameter("1", 0.0, 5.0, 0.0, 0.02, "share of the pressure that is felt in addition")
    time_s: float = parameter("s", 0.05, 5000.0, 5.0, 1.0, "time constant", defining=False)

    decades: float = parameter("1", 0.0, 6.0, 0.0, 0.5, "decades of time constants", defining=False)

    exponent: float = parameter("1", 0.1, 2.0, 1.0, 0.1, "power of the pressure that creeps", defining=False)
    half_pa: float = parameter(
        "Pa", 100.0, 1e6, 1e4, 1e3, "pressure that closes half the gaps, if multiplied", defining=False
    )
    unevenness: float = parameter(
        "1", 0.0, 5.0, 0.0, 0.2, "how much the gaps' widths differ, if multiplied", defining=False
    )
    power: float = parameter(
        "1", -2.0, 2.0, 0.0, 0.2, "power of the resistance that falls in proportion, if multiplied", defining=False
    )

    slip: float = parameter("1", 0.02, 50.0, 1.0, 0.1, "change of log pressure that renews, if aged", defining=False)

    remembers_air: bool = False
    """Whether what a press left behind goes on into the next; otherwise an unloaded spot has recovered."""
    multiplies: bool = False
    """Whether what creeps multiplies the resistance instead of adding to the pressure."""
    ages: bool = False
    """Whether that is the age of the contacts, in a form that ``multiplies``."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.ages and not self.multiplies:
            raise ValueError(f"{self.name}.ages: contacts that age multiply the resistance, so set multiplies too")
        if self.ages and (self.remembers_air or self.decades > 0):
            raise ValueError(f"{self.name}.ages: contacts lose their age in air, without remembers_air and decades")

    def effective_pressure_pa(self, pressure_pa: Array, position_m: Array, time_s: Array, extent_m: Array) -> Array:
        if self.multiplies:
            return pressure_pa
        return pressure_pa + self.fraction * self._taken_in(self._drive(pressure_pa), pressure_pa, time_s)

    def resistance_factor(
        self,
        pressure_pa: Array,
        position_m: Array,
        time_s: Array,
        extent_m: Array,
        wanted: NDArray[np.intp] | None = None,
    ) -> Array | float:
        if not self.multiplies:
            return 1.0
        closed = touching_share(pressure_pa, self.half_pa, self.unevenness)
        if self.ages:
            taken_in = closed * np.log1p(contact_age_s(pressure_pa, time_s, self.slip) / self.time_s)
        else:
            taken_in = self._taken_in(closed, pressure_pa, time_s)
        return self._left(self.fraction * (taken_in if wanted is None else taken_in[wanted]))

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Growth of the log conductance in 10 s of hold at half the specimen's stress after a rise of 2 s, over what
        the law without creep gains."""
        grown, static = self._held(standard)
        return {"share_crept": grown / static}

    def unseen(self, standard: Standard) -> dict[str, float]:
        """The same if a decade of creep faster than what is fitted, as much as in each decade of that, passed for the
        static law: a spectrum goes on where readings no longer tell it."""
        # Of the decade below the fastest that is fitted what a rise doesn't tell from the law.
        decades = float(np.clip(np.log10(RISE_S / (0.1 * self.time_s)), 0.0, 1.0))
        if self.decades == 0 or decades == 0:
            return {}
        grown, static = self._held(standard)
        pressure = standard.hold(0.5, RISE_S, HOLD_S)[1][-1:]
        faster = decades * self.fraction / max(self.decades, 1.0)
        if self.multiplies:
            passed = -float(np.log(self._left(faster * touching_share(pressure, self.half_pa, self.unevenness)))[0])
        else:
            slower = standard.resistance(pressure / (1 + faster * float(self._drive(pressure)[0] / pressure[0])))
            passed = float(np.log(slower / standard.resistance(pressure))[0])
        return {"share_crept": grown / (static - min(passed, MOST_PASSED * static))}

    def _held(self, standard: Standard) -> tuple[float, float]:
        """What the log conductance gains in the hold, and by the law without creep."""
        time_s, pressure = standard.hold(0.5, RISE_S, HOLD_S)
        asked = (pressure[:, None], np.zeros((1, 2)), time_s, standard.extent_m)
        felt, factor = self.effective_pressure_pa(*asked), np.log(self.resistance_factor(*asked))
        log = np.log(standard.resistance(felt[:, 0])) + np.ravel(factor)
        static = np.log(standard.resistance(np.array([0.0, pressure[-1]])))
        risen = int(np.searchsorted(time_s, RISE_S))
        return float(log[risen] - log[-1]), float(static[0] - static[1])

    def _drive(self, pressure_pa: Array) -> Array:
        """What creep that adds to the pressure follows, in pascal."""
        if self.exponent == 1:
            return pressure_pa
        return AGREED_PA * (np.maximum(pressure_pa, 0.0) / AGREED_PA) ** self.exponent

    def _left(self, crept: Array) -> Array:
        """What is left of the resistance where so much of its logarithm, or ``power``, has crept away."""
        if abs(self.power) < SAME:
            return np.exp(-crept)
        # Where more than everything would have crept away a little is left.
        least = LEAST_LEFT**self.power if self.power > 0 else 0.0
        return np.asarray(np.maximum(1.0 - self.power * crept, least) ** (1 / self.power))

    def _taken_in(self, drive: Array, pressure_pa: Array, time_s: Array) -> Array:
        """(T,N) mean of what has followed the drive (T,N) with each time constant."""
        loaded = np.abs(pressure_pa).max(axis=1, initial=0.0) > 0
        cleared = None if self.remembers_air else ~loaded
        constants_s = self.time_s * 10 ** (self.decades * (STEPS if self.decades > 0 else STEPS[:1]))
        return lagging(drive, time_s, constants_s, cleared, moves_s=moves_within_s(time_s))

    @classmethod
    def specimen_starts(cls) -> tuple[Start, ...]:
        ladder, power = ("fraction", "time_s", "decades"), ("fraction", "time_s", "decades", "exponent")
        return (
            Start(cls(fraction=0.05, time_s=2.0), ("fraction", "time_s")),
            Start(cls(fraction=0.05, time_s=30.0), ("fraction", "time_s")),
            Start(cls(fraction=0.05, time_s=0.3, decades=4.0, exponent=0.8, remembers_air=True), power),
            Start(cls(fraction=0.2, time_s=0.05, decades=3.5, exponent=0.5, remembers_air=True), power),
            Start(
                cls(fraction=0.1, time_s=0.3, decades=3.0, remembers_air=True, multiplies=True), (*ladder, "half_pa")
            ),
        )

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        single, ladder = ("fraction", "time_s"), ("fraction", "time_s", "decades")
        spread = cls(time_s=0.3, decades=4.0, remembers_air=True)
        return (
            *(Start(cls(time_s=time_s), single, ("fraction",)) for time_s in (1.0, 5.0, 30.0)),
            *(Start(cls(time_s=time_s, remembers_air=True), single, ("fraction",)) for time_s in (30.0, 300.0)),
            Start(spread, ladder, ("fraction",)),
            Start(replace(spread, multiplies=True), ladder, ("fraction",)),
            Start(cls(time_s=1.0, multiplies=True, ages=True), single, ("fraction",)),
        )

    def freer(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        """How it depends on pressure, in either form; where it multiplies then how uneven gaps are, or their age. Of
        one whose size alone is free first all that its form has."""
        if "time_s" not in free:
            whole = (*free, *self._shape)
            return Start(self, whole), *self.freer(whole)
        if self.ages:
            return () if "slip" in free else (Start(self, (*free, "half_pa", "slip")),)
        if not {"exponent", "half_pa"} & set(free):
            spread = self
            if self.decades == 0:
                spread = replace(self, time_s=max(0.1 * self.time_s, 0.1), decades=3.0, remembers_air=True)
            ladder = ("fraction", "time_s", "decades")
            return (
                Start(replace(spread, exponent=0.8, multiplies=False), (*ladder, "exponent")),
                Start(replace(spread, multiplies=True), (*ladder, "half_pa")),
            )
        if "power" in free:
            return ()
        aged = replace(self, time_s=1.0, decades=0.0, remembers_air=False, multiplies=True, ages=True)
        ageing = ("fraction", "time_s", "half_pa", "slip")
        if "exponent" in free:
            # A share of the pressure says nothing of one of the logarithm.
            return (Start(replace(aged, fraction=AGED, exponent=1.0), ageing),)
        return Start(self.changed({"unevenness": 0.3}), (*free, "unevenness", "power")), Start(aged, ageing)

    @property
    def _shape(self) -> tuple[str, ...]:
        """The numbers that its form has, but for how much there is."""
        if self.ages:
            return "time_s", "half_pa", "slip"
        spread = ("time_s", "decades") if self.decades > 0 else ("time_s",)
        if not self.multiplies:
            return (*spread, "exponent") if self.exponent != 1 else spread
        uneven = ("unevenness", "power") if self.unevenness > 0 or self.power != 0 else ()
        return (*spread, "half_pa", *uneven)

    def at_once(self, free: tuple[str, ...]) -> Start | None:
        """The law that is left where nothing lags, free in all that its form has; gaps that close where contacts age,
        for at one pace their age is such a law's shape."""
        if not (self.multiplies or self.exponent != 1):
            return None
        least_s = self.known("time_s").low
        at_once = replace(self, time_s=least_s, decades=0.0, remembers_air=False, ages=False, slip=1.0)
        shape = dict.fromkeys((*free, *self._shape))
        return Start(at_once, tuple(key for key in shape if key not in ("time_s", "decades", "slip")))
