"""What holds for every effect: the contract of names, neutral values, ranges and configuration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from small_skin import small_sensor

from ertskin.physics.effects.effect import SheetEffect, Stage
from ertskin.physics.effects.registry import build_effects, effect_classes, effects_config
from ertskin.physics.protocol import Protocol, electrode_pairs

NAMES = {
    "nonlinear_foam": "mechanics",
    "viscoelastic_foam": "mechanics",
    "foam_hysteresis": "mechanics",
    "foam_softening": "mechanics",
    "indenter_offset": "mechanics",
    "piezo_hysteresis": "piezoresistance",
    "piezo_creep": "piezoresistance",
    "piezo_inhomogeneity": "piezoresistance",
    "sheet_anisotropy": "conduction",
    "sheet_inhomogeneity": "conduction",
    "temperature_drift": "conduction",
    "contact_pressure_dependence": "electrodes",
    "electrode_displacement": "electrodes",
    "channel_gain": "acquisition",
    "crosstalk": "acquisition",
    "adc_saturation": "acquisition",
    "scan_skew": "acquisition",
}


@pytest.mark.parametrize(("name", "stage"), NAMES.items())
def test_name_of_the_contract_is_there_at_its_stage(name: str, stage: str) -> None:
    assert effect_classes()[name].stage == Stage(stage)


@pytest.mark.parametrize("kind", effect_classes().values(), ids=lambda k: k.name)
def test_parameters_have_unit_range_neutral_and_meaning(kind: type) -> None:
    assert kind.source
    assert kind.__doc__
    for name, known in kind.parameters().items():
        assert known.low <= known.neutral <= known.high, name
        assert known.typical > 0, name
        assert known.unit, name
        assert known.meaning, name
        assert math.isfinite(known.high - known.low), name


@pytest.mark.parametrize("kind", effect_classes().values(), ids=lambda k: k.name)
def test_settings_build_the_same_effect_again(kind: type) -> None:
    effect = kind()
    assert build_effects(effects_config([effect])) == (effect,)


@pytest.mark.parametrize("kind", [k for k in effect_classes().values() if k.parameters()], ids=lambda k: k.name)
def test_value_out_of_range_is_refused(kind: type) -> None:
    name, known = next(iter(kind.parameters().items()))
    with pytest.raises(ValueError, match=f"{kind.name}.{name}"):
        kind(**{name: known.high * 2 + 1})


def test_repeated_effect_survives_the_configuration() -> None:
    config = {"channel_gain": [{"channel": 3, "gain": 0.02}, {"channel": 7, "gain": -0.01}]}
    built = build_effects(config)
    assert [e.channel for e in built] == [3, 7]
    assert build_effects(effects_config(built)) == built


def test_unknown_name_and_parameter_are_refused_in_a_line() -> None:
    with pytest.raises(ValueError, match="no effect named 'nothing'"):
        build_effects({"nothing": {}})
    with pytest.raises(ValueError, match="piezo_creep"):
        build_effects({"piezo_creep": {"wrong": 1.0}})


@pytest.mark.parametrize(
    "kind", [k for k in effect_classes().values() if issubclass(k, SheetEffect)], ids=lambda k: k.name
)
def test_effects_on_the_sheet_are_in_proportion_to_its_conductance(kind: type[SheetEffect]) -> None:
    extent_m, scan = np.array([[0.0, 0.0], [0.1, 0.08]]), Protocol.against_sink(electrode_pairs(6), 6, 1e-4)
    place_m = np.random.default_rng(0).uniform(0.0, 0.08, (7, 2))
    for start in kind.reading_starts(small_sensor(), scan)[:3]:
        known = kind.parameters()
        effect = start.effect.changed({key: known[key].typical for key in start.along})
        once, twice = (effect.conductivity_s(np.full(7, size), place_m, extent_m) for size in (1e-4, 2e-4))
        np.testing.assert_allclose(twice, 2.0 * once, rtol=1e-12)
