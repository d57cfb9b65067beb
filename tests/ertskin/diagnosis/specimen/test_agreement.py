"""A specimen is another piece of fabric: it agrees with a skin that remembers as it does, and says so of no other."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.specimen.signal import SpecimenSignal, remembers_alike
from ertskin.physics.effects.effect import PiezoEffect
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity

NOISE = 0.003
LOOP = PiezoHysteresis(width=0.1)


def specimen(effects: tuple[PiezoEffect, ...]) -> SpecimenSignal:
    """Five triangles of stress up to 60 kPa in half-second steps on a fabric with these effects."""
    stress = np.tile(np.concatenate([np.linspace(0, 6e4, 60), np.linspace(6e4, 0, 60)]), 5)
    time_s = 0.5 * np.arange(len(stress))
    pressure = stress[:, None]
    for effect in effects:
        pressure = effect.effective_pressure_pa(pressure, np.zeros((1, 2)), time_s, np.zeros((2, 2)))
    noise = np.random.default_rng(0).standard_normal(len(stress))
    resistance = 2e4 * (0.2 + 0.8 * np.exp(-pressure[:, 0] / 2e4)) * (1 + NOISE * noise)
    return SpecimenSignal(stress, resistance, time_s, NOISE, effects)


@pytest.mark.parametrize(
    ("own", "skin", "alike"),
    [
        ((), (), True),
        ((LOOP,), (LOOP,), True),
        ((LOOP,), (PiezoHysteresis(width=0.11),), True),
        ((LOOP,), (PiezoHysteresis(width=0.2),), False),
        ((LOOP,), (), False),
        ((), (PiezoCreep(fraction=0.18, time_s=12.0),), False),
        ((), (PiezoInhomogeneity(gradient_x=0.5),), True),
    ],
)
def test_memories_are_compared_on_the_specimen(
    own: tuple[PiezoEffect, ...], skin: tuple[PiezoEffect, ...], alike: bool
) -> None:
    assert remembers_alike(specimen(own), skin, DEFAULT) is alike
