"""The specimen test as a signal of the law. What the specimen remembers is its own: it is another piece of fabric."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.specimen.fit import SpecimenTest
from ertskin.hardware.recording import Specimen
from ertskin.physics.effects.effect import Effect, PiezoEffect
from ertskin.physics.effects.hypothesis import Axis
from ertskin.physics.effects.piezo_chain import fabric_ohm_sq
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SpecimenSignal:
    """N readings of the specimen in recording order; ``noise_fraction`` of the value, ``effects`` of its own fabric."""

    stress_pa: Array
    resistance_ohm_sq: Array
    time_s: Array
    noise_fraction: float
    effects: tuple[PiezoEffect, ...] = ()

    @classmethod
    def of(cls, specimen: Specimen, noise_fraction: float) -> SpecimenSignal:
        """From a recording's specimen, NaN left out."""
        order = np.argsort(specimen.time_s, kind="stable")
        stress, value = specimen.stress_pa[order], specimen.sheet_resistance_ohm_sq[order]
        good = np.isfinite(stress) & np.isfinite(value) & (value > 0)
        return cls(stress[good], value[good], specimen.time_s[order][good], noise_fraction)

    def residual(self, skin: Skin) -> Array:
        """(N,) relative residuals of the skin's law with the specimen's memory, in units of the noise.

        The specimen's own value at zero stress is fitted away.
        """
        ratio = self.resistance_ohm_sq / self._shape(skin)
        return np.asarray((ratio / ratio.mean() - 1) / self.noise_fraction)

    def _shape(self, skin: Skin) -> Array:
        nowhere, extent = np.zeros((1, 2)), skin.sensor.extent_m
        fabric = fabric_ohm_sq(skin.piezo, self.effects, self.stress_pa[:, None], nowhere, self.time_s, extent)
        return fabric[:, 0] / skin.piezo.zero_ohm_sq


def is_memory(effect: Effect) -> TypeGuard[PiezoEffect]:
    """Whether it changes what the fabric is, but not from place to place: where on the sheet the specimen would lie
    nobody knows."""
    return isinstance(effect, PiezoEffect) and Axis.PLACE not in effect.hypothesis.axes


def remembers_alike(specimen: SpecimenSignal, effects: Sequence[Effect], criteria: Criteria) -> bool:
    """Whether what the skin's ``effects`` make of the fabric is what the specimen shows, the law fitted anew."""
    skin = [effect for effect in effects if is_memory(effect)]
    test = SpecimenTest(specimen.stress_pa, specimen.resistance_ohm_sq, specimen.time_s)

    def mean_square(chain: Sequence[PiezoEffect]) -> float:
        return float((test.residual(chain) ** 2).mean())

    own = mean_square(specimen.effects)
    wrong = np.sqrt(max(mean_square(skin) - own, 0.0))
    size = np.sqrt(max(mean_square(()) - own, 0.0))
    return bool(wrong <= criteria.specimen_difference * max(size, np.sqrt(own)))
