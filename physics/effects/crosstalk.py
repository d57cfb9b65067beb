"""A channel keeps part of the one read before."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.physics.effects.effect import AcquisitionEffect, Array, Start, parameter, parameters
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

EARLIER = 3
"""How many readings before the last one are told apart, where each counts by itself."""
BEGINNINGS = "settled", "carried", "discharged"
"""In which order they are tried where channels keep each their own part."""
LASTING = 0.5, 0.7
"""Where fits of a memory of more than one reading begin."""
LONGEST = 0.8
"""A memory that lasts longer is hardly anything but the mean of all readings, which an amplifier's common mode adds:
fitted freely it came to 0.94 to 0.97 on three recordings with that, to 0.4 on one whose dielectric gives back."""


@dataclass(frozen=True)
class Crosstalk(AcquisitionEffect):
    """A reading keeps ``fraction`` of those before it in the scan, where ``channel`` is read (-1: every channel), and
    ``shares`` (M,) more, channel by channel.

    ``before``: ``"channel"``, the channels read before; ``"injection"``, the same channel in the injections before.
    What is kept is the last reading before and, by the part ``lasting``, what that one had found: a mean of all before,
    each counting ``lasting`` times as much as the next, for dielectrics give back slowly; or of that the parts
    ``earlier`` (n,) are the readings two, three and more before, and none still earlier counts. ``begins``: what the
    first channel of an injection finds: ``"carried"``, the last reading of the injection before; ``"discharged"``, an
    empty capacitor; ``"settled"``, its own value already.
    ``passes``: whether readings that aren't taken charge the capacitor all the same, as a multiplexer does that steps
    through all its channels; where contacts of ``driven_ohm``, and of ``contacts_ohm`` (L,) more, electrode by
    electrode, carry the current their voltages are the largest.
    """

    name: ClassVar[str] = "crosstalk"
    source: ClassVar[str] = (
        "Charge left on a multiplexed converter's input capacitor; what its dielectric gives back as in R. A. Pease,"
        " Understand capacitor soakage to optimize analog systems, EDN 27 (1982) 125"
    )
    order: ClassVar[int] = 1
    form_error: ClassVar[float] = 0.2
    hypothesis: ClassVar[Hypothesis] = Hypothesis((Axis.SCAN_ORDER,), (Signal.NONRECIPROCAL,), (Need.MORE_READINGS,))

    fraction: float = parameter("1", 0.0, 0.5, 0.0, 1e-3, "part kept of the reading before")
    lasting: float = parameter(
        "1", 0.0, LONGEST, 0.0, 0.1, "part of what a reading found that the next one finds", defining=False
    )
    driven_ohm: float = parameter(
        "ohm", -1e5, 1e5, 0.0, 100.0, "contact of driven electrodes, beyond what readings tell", defining=False
    )
    shares: tuple[float, ...] = parameters("1", -0.5, 0.5, 0.0, 1e-3, "part more that a channel keeps")
    earlier: tuple[float, ...] = parameters(
        "1", -0.5, 1.0, 0.0, 0.1, "part of what is kept that an earlier reading is", defining=False
    )
    contacts_ohm: tuple[float, ...] = parameters(
        "ohm", -1e5, 1e5, 0.0, 100.0, "contact of a driven electrode, beyond what readings tell", defining=False
    )
    channel: int = -1
    before: str = "channel"
    begins: str = "carried"
    passes: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.before not in ("channel", "injection"):
            raise ValueError(f'crosstalk.before = {self.before!r}: "channel" or "injection"')
        if self.begins not in BEGINNINGS:
            raise ValueError(f"crosstalk.begins = {self.begins!r}: one of {', '.join(BEGINNINGS)}")
        if self.lasting and self.earlier:
            raise ValueError("crosstalk: a memory is lasting, or told by earlier readings")

    def distorted_v(self, voltage_v: Array, protocol: Protocol) -> Array:
        met = protocol.with_passed(voltage_v, self._driven_ohm(protocol.electrodes)) if self.passes else voltage_v
        flat = np.ascontiguousarray(met, dtype=float).reshape(-1, protocol.taken.size)
        order, ends = _runs(protocol, self.before, self.begins == "carried", self.passes)
        kept = np.tile(self._kept(protocol.shape[1]), protocol.shape[0])
        weight = np.array([1 - sum(self.earlier), *self.earlier])
        read = _mixed(flat, order, ends, kept, self.lasting, weight, self.begins == "discharged")
        read = read.reshape(voltage_v.shape)
        return read if protocol.taken.all() else np.where(protocol.taken, read, voltage_v)

    def _driven_ohm(self, electrodes: int) -> Array:
        """(L,) contacts of electrodes that carry current; raises ``ValueError`` where there are some for others."""
        return self.driven_ohm + self._several("contacts_ohm", electrodes, "electrodes")

    def _kept(self, channels: int) -> Array:
        """(M,) what each channel keeps; raises ``ValueError`` where there are shares for other channels."""
        kept = np.full(channels, self.fraction)
        if self.channel >= 0:
            kept[np.arange(channels) != self.channel] = 0.0
        return kept + self._several("shares", channels, "channels")

    def _several(self, name: str, count: int, things: str) -> Array:
        """(count,) several of a kind, nought where none is given; raises ``ValueError`` for another number of them."""
        given = getattr(self, name)
        if given and len(given) != count:
            raise ValueError(f"crosstalk.{name}: {len(given)} given, the scan has {count} {things}")
        return np.array(given) if given else np.zeros(count)

    def size(self, key: str) -> float:
        return float(np.mean(np.abs(self._kept(max(1, len(self.shares)))))) if key == "fraction" else super().size(key)

    def quantities(self, standard: Standard) -> dict[str, float]:
        """What is kept of the reading before, where all channels do: mean over channels."""
        if self.channel >= 0:
            return {}
        kept = self.fraction + (float(np.mean(self.shares)) if self.shares else 0.0)
        return {"share_kept": (1 - self.lasting - sum(self.earlier)) * kept}

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        """All channels alike, however an injection begins, and each alone; a first one may find an empty capacitor."""
        ways, channels = ("channel", "injection"), range(protocol.shape[1])
        contacts = () if protocol.taken.all() else (0.0,) * protocol.electrodes
        alike = cls(fraction=0.01, shares=(0.0,) * protocol.shape[1], contacts_ohm=contacts)
        every = [replace(alike, before=way) for way in ways]
        every += [replace(alike, begins=one) for one in ("discharged", "settled")]
        every += [replace(alike, channel=channel, before=way) for way in ways for channel in channels]
        first = np.unique(protocol.taken.argmax(axis=1)).tolist()
        every += [replace(alike, channel=channel, begins="discharged") for channel in first]
        lasting = [replace(alike, lasting=one) for one in LASTING]
        found = [Start(one, ("fraction",), ("fraction",)) for one in every]
        found += [Start(one, ("fraction", "lasting"), ("fraction",)) for one in lasting]
        if not protocol.taken.all():
            passing = [replace(one, passes=True) for one in (alike, replace(alike, lasting=LASTING[0]))]
            found.append(Start(passing[0], ("fraction", "driven_ohm"), ("fraction",)))
            found.append(Start(passing[1], ("fraction", "driven_ohm", "lasting"), ("fraction",)))
        return tuple(found)

    def freer(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        """With a memory of more than the last reading, channels that each keep their own part, of which the one found
        first may be but the one that keeps the most, contacts of driven electrodes that are passed, a later
        beginning."""
        found = []
        if "lasting" in free:
            found.append(self._by_reading(free))
        elif not self.earlier:
            found += [Start(replace(self, lasting=one), (*free, "lasting")) for one in LASTING]
        if "fraction" in free and self.shares:
            kept = tuple(self._kept(len(self.shares)).tolist())
            each = replace(self, fraction=0.0, channel=-1, shares=kept)
            others = (key for key in free if key != "fraction")
            found.append(Start(each, (*others, *_each("shares", self.shares))))
        if self.contacts_ohm and "contacts_ohm[0]" not in free and self.channel < 0 and self.before == "channel":
            others = (key for key in free if key != "driven_ohm")
            contacts = tuple(self._driven_ohm(len(self.contacts_ohm)).tolist())
            passed = replace(self, passes=True, driven_ohm=0.0, contacts_ohm=contacts)
            found.append(Start(passed, (*others, *_each("contacts_ohm", contacts))))
        if "fraction" not in free and self.before == "channel":
            later = BEGINNINGS[BEGINNINGS.index(self.begins) + 1 :]
            found += [Start(replace(self, begins=one), free) for one in later]
        return tuple(found)

    def _by_reading(self, free: tuple[str, ...]) -> Start:
        """The same memory, of each of the readings before it by itself."""
        weight = (1 - self.lasting) * self.lasting ** np.arange(EARLIER + 1)
        counted = float(weight.sum())
        earlier = tuple((weight[1:] / counted).tolist())
        shares = tuple(counted * share for share in self.shares)
        form = replace(self, fraction=counted * self.fraction, shares=shares, lasting=0.0, earlier=earlier)
        return Start(form, (*(key for key in free if key != "lasting"), *_each("earlier", earlier)))


def _each(name: str, several: tuple[float, ...]) -> list[str]:
    """The names of each of several parameters."""
    return [f"{name}[{k}]" for k in range(len(several))]


@lru_cache(maxsize=16)
def _runs(protocol: Protocol, before: str, carried: bool, passes: bool) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Readings by their numbers (n,), taken or passed one after the other, and where each run of them ends (r,)."""
    number = np.arange(protocol.taken.size).reshape(protocol.shape)
    met = np.ones_like(protocol.taken) if passes else protocol.taken
    if before == "channel":
        runs = [number[met]] if carried else [number[k][met[k]] for k in range(len(number))]
    else:
        runs = [number[met[:, m], m] for m in range(protocol.shape[1])]
    return np.concatenate(runs), np.cumsum([len(run) for run in runs])


@njit(cache=True, nogil=True)
def _mixed(flat, order, ends, kept, lasting, weight, discharged):  # type: ignore[no-untyped-def]
    """Readings (T,N) of which each is by the part ``kept`` (N,) what it found: those before it by their ``weight`` (n,)
    or, where one alone counts, what is left of it; before a run all is as its first reading, or nothing if
    ``discharged``."""
    mixed = flat.copy()
    for t in range(len(flat)):
        begin = 0
        for end in ends:
            found = 0.0
            for k in range(begin, end):
                value = flat[t, order[k]]
                if len(weight) > 1:
                    found = 0.0
                    for j in range(len(weight)):
                        if k - 1 - j >= begin:
                            found += weight[j] * flat[t, order[k - 1 - j]]
                        elif not discharged:
                            found += weight[j] * flat[t, order[begin]]
                elif k > begin:
                    before = flat[t, order[k - 1]]
                    found = lasting * found + (1 - lasting) * before if lasting else before
                elif not discharged:
                    found = value
                if kept[order[k]] != 0.0:
                    mixed[t, order[k]] += kept[order[k]] * (found - value)
            begin = end
    return mixed
