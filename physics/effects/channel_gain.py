"""One channel's gain or offset is off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from physics.effects.effect import AcquisitionEffect, Array, parameter
from physics.protocol import Protocol


@dataclass(frozen=True)
class ChannelGain(AcquisitionEffect):
    """Reading column ``channel`` times 1 + ``gain`` plus ``offset_v``."""

    name: ClassVar[str] = "channel_gain"
    source: ClassVar[str] = "Gain and offset error of an amplifier or multiplexer branch"
    order: ClassVar[int] = 0

    channel: int = 0
    gain: float = parameter("1", -0.5, 0.5, 0.0, 0.01, "relative gain error")
    offset_v: float = parameter("V", -1.0, 1.0, 0.0, 1e-3, "offset")

    def distorted_v(self, voltage_v: Array, protocol: Protocol) -> Array:
        voltage = voltage_v.copy()
        voltage[..., self.channel] = (1 + self.gain) * voltage[..., self.channel] + self.offset_v
        return voltage
