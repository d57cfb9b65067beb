"""A channel keeps part of the one read before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from physics.effects.effect import AcquisitionEffect, Array, parameter
from physics.protocol import Protocol


@dataclass(frozen=True)
class Crosstalk(AcquisitionEffect):
    """A reading keeps ``fraction`` of the one before it in the scan, where ``channel`` is read (-1: every channel).

    ``before``: ``"channel"``, the neighbouring channel of the same injection (the last of the injection before, for
    the first); ``"injection"``, the same channel in the injection before.
    """

    name: ClassVar[str] = "crosstalk"
    source: ClassVar[str] = "Charge left on a multiplexed converter's input capacitor"
    order: ClassVar[int] = 1

    fraction: float = parameter("1", 0.0, 0.5, 0.0, 1e-3, "part kept of the reading before")
    channel: int = -1
    before: str = "channel"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.before not in ("channel", "injection"):
            raise ValueError(f'crosstalk.before = {self.before!r}: "channel" or "injection"')

    def distorted_v(self, voltage_v: Array, protocol: Protocol) -> Array:
        flat = voltage_v.reshape(*voltage_v.shape[:-2], -1)
        lag = 1 if self.before == "channel" else voltage_v.shape[-1]
        previous = np.concatenate([flat[..., :lag], flat[..., :-lag]], axis=-1).reshape(voltage_v.shape)
        columns = slice(None) if self.channel < 0 else slice(self.channel, self.channel + 1)
        mixed = voltage_v.copy()
        mixed[..., columns] += self.fraction * (previous - voltage_v)[..., columns]
        return mixed
