"""Whether what comes in is sound, frame by frame, while a recording runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.instrument import Scan
from ertskin.hardware.validate import saturated_share
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Soundness:
    """One frame: share of saturated readings, irreciprocal part over the whole (rms), noise so far in volt."""

    saturated: float
    reciprocity_defect: float
    noise_v: float

    def warnings(self) -> list[str]:
        """What a person at the bench should hear."""
        found = []
        if self.saturated > 0:
            found.append(f"{100 * self.saturated:.2g} % of readings saturated")
        if self.reciprocity_defect > 0.01:
            found.append(f"reciprocity defect {100 * self.reciprocity_defect:.2g} %")
        return found


class LiveChecks:
    """Follows the scans of one recording."""

    def __init__(self, protocol: Protocol) -> None:
        self._protocol = protocol
        self._taken = protocol.taken.ravel()
        self._basis = protocol.orthonormal[self._taken]
        self._left = 1.0 - self._basis.shape[1] / self._basis.shape[0]
        self._before: Array | None = None
        self._noise_v: list[float] = []

    def look(self, scan: Scan) -> Soundness:
        """Judge a scan. Noise is from what no resistor network could give in the difference of successive scans."""
        flat = scan.voltage_v.reshape(-1)[self._taken].astype(float)
        irreciprocal = flat - self._basis @ (self._basis.T @ flat)
        if self._before is not None and self._left > 0:
            step = irreciprocal - self._before
            self._noise_v.append(1.4826 * float(np.median(np.abs(step))) / np.sqrt(2.0 * self._left))
        self._before = irreciprocal
        rms = float(np.sqrt(np.mean(flat**2))) or 1.0
        saturated = saturated_share(scan.voltage_v, self._protocol)
        if scan.saturated is not None:
            saturated = max(saturated, float(scan.saturated.mean()))
        noise = float(np.median(self._noise_v[-200:])) if self._noise_v else 0.0
        return Soundness(saturated, float(np.sqrt(np.mean(irreciprocal**2))) / rms, noise)
