"""The specimen alone: effects put into a loop of known stress are found again, and none where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.specimen.fit import SpecimenTest, specimen_findings
from ertskin.physics.effects.effect import PiezoEffect
from ertskin.physics.effects.piezo_chain import felt
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis

NOISE = 0.003


def specimen(effects: tuple[PiezoEffect, ...], seed: int) -> SpecimenTest:
    """Three triangles of stress up to 60 kPa with a hold on top, in steps of half a second."""
    cycle = np.concatenate([np.linspace(0, 6e4, 40), np.full(30, 6e4), np.linspace(6e4, 0, 40), np.zeros(20)])
    stress = np.tile(cycle, 3)
    time_s = 0.5 * np.arange(len(stress))
    pressure, factor = felt(effects, stress[:, None], np.zeros((1, 2)), time_s, np.zeros((2, 2)))
    resistance = 2e4 * (0.2 + 0.8 * np.exp(-pressure[:, 0] / 2e4)) * np.ravel(factor)
    noise = np.random.default_rng(seed).standard_normal(len(stress))
    return SpecimenTest(stress, resistance * (1 + NOISE * noise), time_s)


@pytest.mark.parametrize("seed", range(10))
def test_a_clean_specimen_shows_nothing(seed: int) -> None:
    findings, noise = specimen_findings(specimen((), seed), DEFAULT)
    assert findings == []
    assert noise == pytest.approx(NOISE, rel=0.15)


def test_hysteresis_is_distinguished_from_creep() -> None:
    findings, noise = specimen_findings(specimen((PiezoHysteresis(width=0.06),), 1), DEFAULT)
    assert [f.effect.name for f in findings] == ["piezo_hysteresis"]
    assert findings[0].effect.values()["width"] == pytest.approx(0.06, rel=0.05)
    assert min(rival.short for rival in findings[0].rivals) > 50
    assert noise == pytest.approx(NOISE, rel=0.15)


def test_creep_is_distinguished_from_hysteresis() -> None:
    findings, _ = specimen_findings(specimen((PiezoCreep(fraction=0.2, time_s=6.0),), 2), DEFAULT)
    assert [f.effect.name for f in findings] == ["piezo_creep"]
    assert findings[0].effect.values()["time_s"] == pytest.approx(6.0, rel=0.1)


def test_both_at_once() -> None:
    findings, noise = specimen_findings(specimen((PiezoHysteresis(width=0.08), PiezoCreep(0.1, 8.0)), 3), DEFAULT)
    assert {f.effect.name for f in findings} == {"piezo_hysteresis", "piezo_creep"}
    assert noise == pytest.approx(NOISE, rel=0.15)


@pytest.mark.parametrize(
    "effect",
    [
        PiezoCreep(0.1, 1.0, half_pa=2e4, slip=1.2, multiplies=True, ages=True),
        PiezoCreep(0.8, 2.0, decades=2.0, half_pa=2e4, unevenness=2.0, remembers_air=True, multiplies=True),
        PiezoCreep(0.8, 2.0, decades=2.0, half_pa=2e4, power=-0.8, remembers_air=True, multiplies=True),
        PiezoHysteresis(width=0.2, spread=0.6),
    ],
    ids=["contacts that age", "gaps of uneven widths", "a power", "plays of several widths"],
)
def test_a_form_that_only_freeing_leads_to_is_found(effect: PiezoEffect) -> None:
    (found,), noise = specimen_findings(specimen((effect,), 4), DEFAULT)
    assert noise == pytest.approx(NOISE, rel=0.15)
    assert found.effect.name == effect.name
    for key, error in zip(found.free, found.error, strict=True):
        if effect.known(key).defining:
            assert found.effect.value(key) == pytest.approx(effect.value(key), abs=5 * error), key


def test_creep_over_as_many_decades_as_there_may_be_is_creep_alone() -> None:
    creep = PiezoCreep(1.0, 0.3, decades=6.0, half_pa=2e4, remembers_air=True, multiplies=True)
    (found,), noise = specimen_findings(specimen((creep,), 4), DEFAULT)
    assert found.effect.name == "piezo_creep"
    assert noise == pytest.approx(NOISE, rel=0.15)


@pytest.mark.parametrize(("dead_pa", "held", "in_air"), [(8e3, 30, 0), (4e3, 30, 20), (8e3, 30, 20), (8e3, 0, 20)])
def test_creep_at_once_is_another_static_law(dead_pa: float, held: int, in_air: int) -> None:
    press = [np.linspace(0, 6e4, 40), np.full(held, 6e4), np.linspace(6e4, 0, 40), np.zeros(in_air)]
    stress = np.tile(np.concatenate(press), 3)
    time_s = 0.5 * np.arange(len(stress))
    resistance = 2e4 * (0.2 + 0.8 * np.exp(-np.maximum(stress - dead_pa, 0.0) / 2e4))
    noise = 0.001 * np.random.default_rng(6).standard_normal(len(stress))
    findings, left = specimen_findings(SpecimenTest(stress, resistance * (1 + noise), time_s), DEFAULT)
    assert findings == []
    assert left > 0.002


def test_a_dead_zone_beside_a_loop_is_no_creep() -> None:
    stress = np.tile(np.concatenate([np.linspace(0, 6e4, 40), np.full(30, 6e4), np.linspace(6e4, 0, 40)]), 3)
    time_s = 0.5 * np.arange(len(stress))
    loop = PiezoHysteresis(width=0.1).effective_pressure_pa(stress[:, None], np.zeros((1, 2)), time_s, np.zeros((2, 2)))
    resistance = 2e4 * (0.2 + 0.8 * np.exp(-np.maximum(loop[:, 0] - 6e3, 0.0) / 2e4))
    noise = 0.001 * np.random.default_rng(7).standard_normal(len(stress))
    findings, _ = specimen_findings(SpecimenTest(stress, resistance * (1 + noise), time_s), DEFAULT)
    assert [f.effect.name for f in findings] == ["piezo_hysteresis"]
