"""What one run of measurements holds, in memory: the parts of the recording file (format version 1). SI units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]


class RecordingError(ValueError):
    """A recording that can't be interpreted: one line naming the file, the field, what was found, what was expected."""


@dataclass(frozen=True, eq=False)
class Frames:
    """T scans: ``voltage_v`` (T,K,M) float32 and what was done to the skin during each.

    ``adc_count`` (T,K,M) int32 keeps the converter's raw counts where the reader gave them.
    """

    voltage_v: NDArray[np.float32]
    history: History
    adc_count: NDArray[np.int32] | None = None

    def __len__(self) -> int:
        return len(self.voltage_v)

    def __getitem__(self, frames: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Frames:
        """The frames selected, as frames of their own."""
        count = None if self.adc_count is None else self.adc_count[frames]
        return Frames(self.voltage_v[frames], self.history[frames], count)


@dataclass(frozen=True, eq=False)
class Specimen:
    """The compressometer test of the piezoresistive pair (paper II-C): four (N,) columns."""

    stress_pa: Array
    sheet_resistance_ohm_sq: Array
    time_s: Array
    cycle: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class RigidBlock:
    """Pseudo-indentation of a rigid block, for the stiffness of the indenter's support (paper III-B, equation 4)."""

    depth_m: Array
    force_n: Array


@dataclass(frozen=True, eq=False)
class Coupon:
    """A compression test of a foam coupon: (N,) columns, ``lateral`` is ``"free"`` or ``"confined"``."""

    time_s: Array
    gap_m: Array
    force_n: Array
    height_m: float
    area_m2: float
    lateral: str
    sample_s: float | None = None


@dataclass(frozen=True, eq=False)
class Recording:
    """One run of measurements on one sensor; the parts a rig has no measurement of are ``None``."""

    rig: str
    created: str
    comment: str = ""
    sensor: Sensor | None = None
    protocol: Protocol | None = None
    frames: Frames | None = None
    specimen: Specimen | None = None
    rigid_block: RigidBlock | None = None
    coupon: Coupon | None = None
