"""What an effect is: a small parametric term at one stage of the forward chain, with physical parameters.

An effect is a frozen dataclass in a file of its own. Its continuous parameters are declared by ``parameter`` with unit,
range and the neutral value at which the effect vanishes; fields without that metadata choose a variant (which
electrode, which form). The subclasses below fix what an effect of each stage does to the chain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.effects.hypothesis import Hypothesis, Signal
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

if TYPE_CHECKING:
    from ertskin.physics.effects.standard import Standard

Array = NDArray[np.float64]


class Stage(StrEnum):
    """Stages of the forward chain, in its order."""

    MECHANICS = "mechanics"
    PIEZORESISTANCE = "piezoresistance"
    CONDUCTION = "conduction"
    ELECTRODES = "electrodes"
    ACQUISITION = "acquisition"


@dataclass(frozen=True)
class Parameter:
    """A continuous parameter: SI ``unit``, allowed range, the value at which it changes nothing, what it means.

    ``typical`` is the size of change a fit starts from; ``defining`` says that the effect is absent at ``neutral``
    (a time constant has no such value).
    """

    unit: str
    low: float
    high: float
    neutral: float
    typical: float
    meaning: str
    defining: bool = True


def parameter(
    unit: str, low: float, high: float, neutral: float, typical: float, meaning: str, *, defining: bool = True
) -> Any:
    """A dataclass field holding a continuous parameter, neutral by default."""
    return field(
        default=neutral,
        metadata={"parameter": Parameter(unit, low, high, neutral, typical, meaning, defining)},
    )


def parameters(
    unit: str, low: float, high: float, neutral: float, typical: float, meaning: str, *, defining: bool = True
) -> Any:
    """A dataclass field (n,) of several of a kind, none by default: ``name[k]`` is the k-th of a field ``name``."""
    return field(default=(), metadata={"parameters": Parameter(unit, low, high, neutral, typical, meaning, defining)})


@dataclass(frozen=True)
class Effect:
    """Base of every effect; ``name`` as in the design's table, ``source`` what the form rests on.

    ``hypothesis`` and the methods from ``force_starts`` on are what a diagnosis looks for the effect by.
    """

    name: ClassVar[str]
    stage: ClassVar[Stage]
    source: ClassVar[str]
    hypothesis: ClassVar[Hypothesis]
    form_error: ClassVar[float] = 0.02
    """Share by which its quantities may be off because the real thing has another form, which no fit tells: half a 90 %
    interval. Of those above the least, what other forms came out at in ``experiments/concealed/results``."""

    def __post_init__(self) -> None:
        for key, known in self.parameters().items():
            value = getattr(self, key)
            if not known.low <= value <= known.high:
                raise ValueError(f"{self.name}.{key} = {value:g} {known.unit}: outside [{known.low:g}, {known.high:g}]")
        for key, known in self.several().items():
            if any(not known.low <= value <= known.high for value in getattr(self, key)):
                raise ValueError(f"{self.name}.{key}: all in [{known.low:g}, {known.high:g}] {known.unit}")

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """The continuous parameters by name, in order of declaration."""
        return {f.name: f.metadata["parameter"] for f in fields(cls) if "parameter" in f.metadata}

    @classmethod
    def several(cls) -> dict[str, Parameter]:
        """Those that come several of a kind, one for each channel say, by the name that they share."""
        return {f.name: f.metadata["parameters"] for f in fields(cls) if "parameters" in f.metadata}

    def values(self) -> dict[str, float]:
        """The continuous parameters' values."""
        return {key: float(getattr(self, key)) for key in self.parameters()}

    def known(self, key: str) -> Parameter:
        """What is known of a parameter, or of one of several (``name[k]``)."""
        name, number = _indexed(key)
        return (self.parameters() if number is None else self.several())[name]

    def value(self, key: str) -> float:
        """A parameter's value, or that of one of several."""
        name, number = _indexed(key)
        found = getattr(self, name)
        return float(found if number is None else found[number])

    def changed(self, values: Mapping[str, Any]) -> Self:
        """The same effect with some fields replaced, or some of several parameters."""
        whole: dict[str, Any] = {}
        for key, value in values.items():
            name, number = _indexed(key)
            if number is None:
                whole[name] = value
            else:
                several = whole.setdefault(name, getattr(self, name))
                if number >= len(several):
                    raise ValueError(f"{self.name}.{key}: there are {len(several)}")
                whole[name] = (*several[:number], value, *several[number + 1 :])
        return replace(self, **whole)

    def settings(self) -> dict[str, Any]:
        """Every field as plain Python, for a configuration file."""
        return {f.name: _as_builtins(getattr(self, f.name)) for f in fields(self)}

    @property
    def signals(self) -> tuple[Signal, ...]:
        """What shows it in the form at hand."""
        return self.hypothesis.signals

    @property
    def place(self) -> tuple[tuple[float, float], float] | None:
        """Middle and radius in metre of where on the sheet it is, None where that is nowhere in particular."""
        return None

    def quantities(self, standard: Standard) -> dict[str, float]:
        """What the effect does under stated conditions, by names that mean the same in any form of it."""
        return {}

    def unseen(self, standard: Standard) -> dict[str, float]:
        """Quantities as they would be with more of the effect where no reading tells it: their intervals reach so far.
        Those that owe nothing to that are left out."""
        return {}

    def map_at(self, position_m: Array, extent_m: Array) -> Array | None:
        """(N,) logarithm of a property's factor at positions (N,2) of a sheet in the box ``extent_m`` (2,2), if any."""
        return None

    @classmethod
    def force_starts(cls) -> Sequence[Start]:
        """Where fits of force over depth begin; for each start all but the parameters held are free."""
        return ()

    @classmethod
    def specimen_starts(cls) -> Sequence[Start]:
        """Where fits of the specimen's resistance over stress begin."""
        return ()

    @classmethod
    def coupon_starts(cls) -> Sequence[Start]:
        """Where fits of a foam coupon's compression test begin."""
        return ()

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> Sequence[Start]:
        """Where fits of the readings begin."""
        return ()

    def in_fabric(self) -> PiezoEffect | None:
        """What it does to the fabric under pressure, None for nothing."""
        return None

    def freer(self, free: tuple[str, ...]) -> Sequence[Start]:
        """The effect with more of its form free than the parameters ``free``, or in its other forms, in the order in
        which they are tried; none where there is no more to free."""
        return ()

    def within_scans(self, protocol: Protocol) -> Self:
        """The same as readings show it where forces, each a mean over its scan, drive the skin."""
        return self

    def at_once(self, free: tuple[str, ...]) -> Start | None:
        """What follows a press at once, as a static law does, where the effect, its parameters ``free``, would follow
        in time; None of what has no such limit, or none that the law at hand doesn't hold already."""
        return None

    def misread(self) -> dict[str, float]:
        """Parameters that the readings tell, as they would be if the sheet felt the whole force and the load cell, at a
        stop or its limit, showed too little; none of an effect that makes forces no smaller than that."""
        return {}


def shown_by(effect: Effect | type[Effect], signal: Signal) -> bool:
    """Whether a signal shows an effect in the form at hand, or in any form of its kind."""
    return signal in (effect.hypothesis.signals if isinstance(effect, type) else effect.signals)


@dataclass(frozen=True)
class Start:
    """Where a fit begins: an effect, the parameters that are ``free``, and those screened for ``along``, from neutral.

    Without any to go along the whole effect is screened, which may then be a share of what it is here. ``reciprocal``:
    a form that resistor networks show, of an effect with others that none does.
    """

    effect: Effect
    free: tuple[str, ...]
    along: tuple[str, ...] = ()
    reciprocal: bool = False


def _indexed(key: str) -> tuple[str, int | None]:
    """A field's name and which of its several parameters a key means."""
    name, _, number = key.partition("[")
    return name, int(number.rstrip("]")) if number else None


def _as_builtins(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_as_builtins(v) for v in value]
    return value.item() if isinstance(value, np.generic) else value


@dataclass(frozen=True)
class Strokes:
    """What the foam under one contact column went through, frame by frame (T,).

    ``sink_m`` how far the pad's top is pressed in (the support's yielding taken off), ``elastic_n`` force of the linear
    pad there, ``touched`` where a contact presses, ``place`` which spot of the pad (numbered), ``press`` the press's
    number, ``foam_m`` the top layer's thickness.
    """

    sink_m: Array
    elastic_n: Array
    time_s: Array
    touched: NDArray[np.bool_]
    place: NDArray[np.intp]
    press: NDArray[np.int64]
    foam_m: float


@dataclass(frozen=True)
class FoamEffect(Effect):
    """A mechanics effect that changes the pad's reaction force."""

    stage: ClassVar[Stage] = Stage.MECHANICS
    order: ClassVar[int] = 0

    def reaction_n(self, force_n: Array, strokes: Strokes) -> Array:
        """(T,) the pad's force in newton, from the force (T,) of the effects before this one."""
        raise NotImplementedError

    def felt_n(self, force_n: Array, pad_n_per_m: float, foam_m: float) -> Array:
        """(...,) force in newton that reaches the sheet as pressure, of forces (...,) on the indenter."""
        return force_n


@dataclass(frozen=True)
class PlacementEffect(Effect):
    """A mechanics effect that changes where the indenter lands."""

    stage: ClassVar[Stage] = Stage.MECHANICS

    def contact_m(self, commanded_m: Array, center_m: Array) -> Array:
        """(...,2) true positions on the sheet of commanded positions (...,2); ``center_m`` (2,) the sheet's middle."""
        raise NotImplementedError


@dataclass(frozen=True)
class PiezoEffect(Effect):
    """A piezoresistance effect: what pressure the fabric's law answers to, what multiplies or raises its resistance."""

    stage: ClassVar[Stage] = Stage.PIEZORESISTANCE
    order: ClassVar[int] = 0

    def in_fabric(self) -> PiezoEffect | None:
        return self

    def effective_pressure_pa(self, pressure_pa: Array, position_m: Array, time_s: Array, extent_m: Array) -> Array:
        """(T,N) pascal, from pressures (T,N) at points (N,2) over times (T,); ``extent_m`` (2,2) the sheet's box."""
        return pressure_pa

    def resistance_factor(
        self,
        pressure_pa: Array,
        position_m: Array,
        time_s: Array,
        extent_m: Array,
        wanted: NDArray[np.intp] | None = None,
    ) -> Array | float:
        """(n,N) factor on the law's resistance at the ``wanted`` times (n,), all T by default, from the pressures (T,N)
        before this effect."""
        return 1.0

    def response_power(self, position_m: Array, extent_m: Array) -> Array | None:
        """(N,) power to which, at points (N,2), the law's resistance over that at rest is raised; None for 1."""
        return None


@dataclass(frozen=True)
class SheetEffect(Effect):
    """A conduction effect: the sheet's own conductance."""

    stage: ClassVar[Stage] = Stage.CONDUCTION
    order: ClassVar[int] = 0
    form_error_at_rest: ClassVar[float] = 0.02
    """Share of what its ``warmth`` does at rest that the real thing's form may leave."""

    def conductivity_s(self, conductivity_s: Array, position_m: Array, extent_m: Array) -> Array:
        """(...,N) or (...,N,3) sheet conductance [xx, xy, yy] from (...,N) or (...,N,3) at points (N,2), and in
        proportion to it."""
        return conductivity_s

    def drift(self, time_s: Array) -> Array:
        """(T,) factor on the whole sheet's resistance over recording time (T,)."""
        return np.ones(len(time_s))

    def warmth(
        self, position_m: Array, time_s: Array, sensor: Sensor, protocol: Protocol
    ) -> tuple[Array, Array] | None:
        """What comes and goes at some places, pressed or not: logarithm of the conductance's factor, as its parts by
        place (N,) and by recording time (T,), of which it is the product; None where there is no such thing."""
        return None

    def warm_through(self, position_m: Array, sensor: Sensor, protocol: Protocol) -> Array | None:
        """(N,) what that comes to once scans have followed one another for long; None where they have no part in it."""
        return None


@dataclass(frozen=True)
class ElectrodeEffect(Effect):
    """An effect of the electrodes."""

    stage: ClassVar[Stage] = Stage.ELECTRODES
    by_pressure: ClassVar[bool] = False
    """Whether every spot of a contact follows the pressure there, or where a field ``evenly`` is set the mean on the
    contact: ``contact_resistance_ohm`` then takes pressures and resistances of any one shape, those of spots as if each
    had the whole contact's size. Others meet no pressure."""

    def contact_resistance_ohm(self, resistance_ohm: Array, pressure_pa: Array, time_s: Array) -> Array:
        """(T,L) ohm, from contact resistances (T,L) and interface pressures on them (T,L) over times (T,)."""
        return resistance_ohm

    def most_taken_ohm(self, electrodes: int) -> Array:
        """(L,) ohm that it takes off each contact at most, whatever that has: contacts must have more."""
        return np.zeros(electrodes)

    def geometry(self, sensor: Sensor) -> Sensor:
        """The sensor as it really is."""
        return sensor

    @classmethod
    def displaces(cls) -> bool:
        """Whether it moves electrodes: a skin with it needs a mesh of its own."""
        return cls.geometry is not ElectrodeEffect.geometry


@dataclass(frozen=True)
class AcquisitionEffect(Effect):
    """An effect of the instrument, on the readings; ``linear`` where twice the readings read twice, offsets apart,
    ``by_reading`` where it is the same for all and at all times, so that readings of any shape will do."""

    stage: ClassVar[Stage] = Stage.ACQUISITION
    order: ClassVar[int] = 0
    linear: ClassVar[bool] = True
    by_reading: ClassVar[bool] = False

    def distorted_v(self, voltage_v: Array, protocol: Protocol) -> Array:
        """(T,K,M) what the instrument says of readings (T,K,M) in volt."""
        raise NotImplementedError

    def part_at(self, time_s: Array) -> Array | None:
        """(T,) part of it that there is at each recording time (T,) by itself; None for all of it, always."""
        return None

    def read_v(self, voltage_v: Array, protocol: Protocol, time_s: Array) -> Array:
        """(T,K,M) what the instrument says of readings (T,K,M) in volt at times (T,)."""
        read, part = self.distorted_v(voltage_v, protocol), self.part_at(time_s)
        return read if part is None else voltage_v + part[:, None, None] * (read - voltage_v)

    def size(self, key: str) -> float:
        """How large a parameter is, either sign, the mean of several that stand for it."""
        return abs(self.value(key))

    def scaled_to(self, largest_v: float) -> Self:
        """The same where no reading is larger than ``largest_v``, either sign: an effect that isn't linear is told by
        how large readings are."""
        return self


@dataclass(frozen=True)
class MotionEffect(Effect):
    """An effect of the acquisition: contacts move while they are scanned.

    ``straight``: readings run straight from those of the scan's beginning to those of its end, not as the skin's do.
    """

    stage: ClassVar[Stage] = Stage.ACQUISITION

    straight: bool = field(default=False, kw_only=True)

    @property
    def moves(self) -> bool:
        """Whether anything moves at all."""
        raise NotImplementedError

    def depth_m(self, history: History, after_s: Array) -> Array:
        """(T,S,P) depth in metre at ``after_s`` (S,) into every scan, the first and the last of them its ends."""
        raise NotImplementedError

    def at_speed(self, speed_m_per_s: float) -> Self:
        """The same where the stage moves at this speed."""
        raise NotImplementedError
