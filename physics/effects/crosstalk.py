"""A channel keeps part of the one read before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.effects.effect import AcquisitionEffect, Array, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

BEGINNINGS = "carried", "discharged", "settled"


@dataclass(frozen=True)
class Crosstalk(AcquisitionEffect):
    """A reading keeps ``fraction`` of the one before it in the scan, where ``channel`` is read (-1: every channel).

    ``before``: ``"channel"``, the neighbouring channel of the same injection; ``"injection"``, the same channel in the
    injection before. ``begins``: what the first channel of an injection finds: ``"carried"``, the last reading of the
    injection before; ``"discharged"``, an empty capacitor; ``"settled"``, its own value already.
    """

    name: ClassVar[str] = "crosstalk"
    source: ClassVar[str] = "Charge left on a multiplexed converter's input capacitor"
    order: ClassVar[int] = 1
    form_error: ClassVar[float] = 0.2
    hypothesis: ClassVar[Hypothesis] = Hypothesis((Axis.SCAN_ORDER,), (Signal.NONRECIPROCAL,), (Need.MORE_READINGS,))

    fraction: float = parameter("1", 0.0, 0.5, 0.0, 1e-3, "part kept of the reading before")
    channel: int = -1
    before: str = "channel"
    begins: str = "carried"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.before not in ("channel", "injection"):
            raise ValueError(f'crosstalk.before = {self.before!r}: "channel" or "injection"')
        if self.begins not in BEGINNINGS:
            raise ValueError(f"crosstalk.begins = {self.begins!r}: one of {', '.join(BEGINNINGS)}")

    def distorted_v(self, voltage_v: Array, protocol: Protocol) -> Array:
        flat = voltage_v.reshape(*voltage_v.shape[:-2], -1)
        previous = flat[..., _read_before(protocol, self.before)].reshape(voltage_v.shape)
        if self.before == "channel" and self.begins != "carried":
            first = np.arange(protocol.shape[0]), protocol.taken.argmax(axis=1)
            previous[..., *first] = 0.0 if self.begins == "discharged" else voltage_v[..., *first]
        columns = slice(None) if self.channel < 0 else slice(self.channel, self.channel + 1)
        mixed = voltage_v.copy()
        mixed[..., columns] += self.fraction * (previous - voltage_v)[..., columns]
        return mixed

    def quantities(self, standard: Standard) -> dict[str, float]:
        """What is kept of the reading before, where all channels do."""
        return {"share_kept": self.fraction} if self.channel < 0 else {}

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        """All channels alike, however an injection begins, and each alone; a first one may find an empty capacitor."""
        ways, channels = ("channel", "injection"), range(-1, protocol.shape[1])
        every = [cls(fraction=0.01, channel=channel, before=way) for way in ways for channel in channels]
        every += [cls(fraction=0.01, begins=begins) for begins in BEGINNINGS[1:]]
        first = np.unique(protocol.taken.argmax(axis=1)).tolist()
        every += [cls(fraction=0.01, channel=channel, begins=BEGINNINGS[1]) for channel in first]
        return tuple(Start(one, ("fraction",), ("fraction",)) for one in every)


def _read_before(protocol: Protocol, before: str) -> NDArray[np.intp]:
    """(K*M,) number of the reading taken before each; itself for the first, and where none is taken."""
    number, taken = np.arange(protocol.taken.size).reshape(protocol.shape), protocol.taken.ravel()
    found = number.ravel().copy()
    for run in [number.ravel()] if before == "channel" else number.T:
        read = run[taken[run]]
        found[read[1:]] = read[:-1]
    return found
