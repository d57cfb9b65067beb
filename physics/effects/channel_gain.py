"""One channel's gain or offset is off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ertskin.physics.effects.effect import AcquisitionEffect, Array, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Measured, Need, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor


@dataclass(frozen=True)
class ChannelGain(AcquisitionEffect):
    """Reading column ``channel`` times 1 + ``gain`` plus ``offset_v``; a gain that drifts as the amplifier warms is
    told by its mean, and leaves what changes with time."""

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
    gain: float = parameter("1", -0.5, 0.5, 0.0, 0.01, "relative gain error")
    offset_v: float = parameter("V", -1.0, 1.0, 0.0, 1e-3, "offset")

    def distorted_v(self, voltage_v: Array, protocol: Protocol) -> Array:
        voltage = voltage_v.copy()
        offset_v = self.offset_v * protocol.taken[:, self.channel]
        voltage[..., self.channel] = (1 + self.gain) * voltage[..., self.channel] + offset_v
        return voltage

    def quantities(self, standard: Standard) -> dict[str, float]:
        """The gain, less one."""
        return {"gain_less_one": self.gain}

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        both = ("gain", "offset_v")
        return tuple(
            Start(cls(channel, **{key: 0.01}), both, (key,)) for channel in range(protocol.shape[1]) for key in both
        )
