"""The specimen test as a signal: it holds the law, and shows the fabric's own hysteresis and creep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hardware.recording import Specimen
from physics.effects.piezo_chain import fabric_ohm_sq
from physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from physics.skin import Skin

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SpecimenSignal:
    """N readings of the specimen in recording order; ``noise_fraction`` of the value."""

    stress_pa: Array
    resistance_ohm_sq: Array
    time_s: Array
    noise_fraction: float

    @classmethod
    def of(cls, specimen: Specimen, noise_fraction: float) -> SpecimenSignal:
        """From a recording's specimen, NaN left out."""
        order = np.argsort(specimen.time_s, kind="stable")
        stress, value = specimen.stress_pa[order], specimen.sheet_resistance_ohm_sq[order]
        good = np.isfinite(stress) & np.isfinite(value) & (value > 0)
        return cls(stress[good], value[good], specimen.time_s[order][good], noise_fraction)

    def residual(self, skin: Skin) -> Array:
        """(N,) relative residuals in units of the noise; the specimen's own value at zero stress is fitted away."""
        ratio = self.resistance_ohm_sq / self._shape(skin)
        return np.asarray((ratio / ratio.mean() - 1) / self.noise_fraction)

    def _shape(self, skin: Skin) -> Array:
        effects = [e for e in skin.effects if not isinstance(e, PiezoInhomogeneity)]
        nowhere, extent = np.zeros((1, 2)), skin.sensor.extent_m
        fabric = fabric_ohm_sq(skin.piezo, effects, self.stress_pa[:, None], nowhere, self.time_s, extent)
        return fabric[:, 0] / skin.piezo.zero_ohm_sq
