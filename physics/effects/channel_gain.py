"""One channel's gain or offset is off."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import AcquisitionEffect, Array, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Measured, Need, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

STATED_S = 200.0
"""Into the recording, when the gain is stated."""


@dataclass(frozen=True)
class ChannelGain(AcquisitionEffect):
    """Reading column ``channel`` times 1 + c ``gain`` plus c ``offset_v``; c comes to 1 as the amplifier warms.

    c = 1 - ``cold`` exp(-t/``warms_s``), t counted from the recording's first frame.
    """

    name: ClassVar[str] = "channel_gain"
    source: ClassVar[str] = "Gain and offset error of an amplifier or multiplexer branch"
    order: ClassVar[int] = 0
    form_error: ClassVar[float] = 0.25
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.ELECTRODE, Axis.TIME),
        (Signal.NONRECIPROCAL,),
        (Need.MORE_READINGS,),
        measured=Measured.CHANNEL_ERROR,
    )

    channel: int = 0
    gain: float = parameter("1", -0.5, 0.5, 0.0, 0.01, "relative gain error, once warm")
    offset_v: float = parameter("V", -1.0, 1.0, 0.0, 1e-3, "offset, once warm")
    cold: float = parameter("1", -3.0, 3.0, 0.0, 0.1, "part of both that isn't there at the beginning", defining=False)
    warms_s: float = parameter("s", 10.0, 2e4, 200.0, 50.0, "time constant of its coming", defining=False)

    def part_at(self, time_s: Array) -> Array | None:
        return 1.0 - self.cold * np.exp(-time_s / self.warms_s) if self.cold else None

    def distorted_v(self, voltage_v: Array, protocol: Protocol) -> Array:
        voltage = voltage_v.copy()
        offset_v = self.offset_v * protocol.taken[:, self.channel]
        voltage[..., self.channel] = (1 + self.gain) * voltage[..., self.channel] + offset_v
        return voltage

    def quantities(self, standard: Standard) -> dict[str, float]:
        """The gain 200 s after the recording's first frame, less one."""
        part = self.part_at(np.array([STATED_S]))
        return {"gain_less_one": self.gain if part is None else float(self.gain * part[0])}

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        both = ("gain", "offset_v")
        return tuple(
            Start(cls(channel, **{key: 0.01}), both, (key,)) for channel in range(protocol.shape[1]) for key in both
        )

    def freer(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        """An amplifier that warms, soon or slowly."""
        if "cold" in free:
            return ()
        warming = (replace(self, cold=0.2, warms_s=warms_s) for warms_s in (100.0, 1000.0))
        return tuple(Start(one, (*free, "cold", "warms_s")) for one in warming)
