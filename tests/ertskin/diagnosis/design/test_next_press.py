"""The press asked for is one that tells the rivals apart, and one the rig can carry out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_skin import SMALL, TAXELS, small_law, small_sensor

import ertskin.diagnosis.design.next_press as design
from ertskin.diagnosis.design.next_press import Feasible, discrimination, next_press
from ertskin.hardware.plan import plan_from_presses
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.foam_hysteresis import FoamHysteresis
from ertskin.physics.effects.indenter_offset import IndenterOffset
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.scan_skew import ScanSkew
from ertskin.physics.effects.viscoelastic_foam import ViscoelasticFoam
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

NOISE_V, FORCE_NOISE_N = 2e-3, 0.02


@pytest.fixture(scope="module")
def skin() -> Skin:
    """A small skin without effects."""
    scan = Protocol.against_sink(electrode_pairs(6), 6, 1e-4, injection_offset_s=np.linspace(0.0, 0.4, 15))
    return Skin.build(small_sensor(), scan, small_law(), np.full(6, 300.0), 9000.0, resolution=SMALL)


@pytest.fixture(autouse=True)
def small_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six electrodes need no finer mesh."""
    monkeypatch.setattr(design, "COARSE", SMALL)


FEASIBLE = Feasible(tuple((float(x), float(y)) for x, y in TAXELS[[1, 0, 2, 3]]), (2e-3, 1e-3))


def asked(skin: Skin, own: Effect | None, rivals: dict[str, Effect | None], feasible: Feasible = FEASIBLE) -> dict:
    """The press for a skin with the effect ``own``, fitted rivals having another one or none."""

    def having(effect: Effect | None) -> Skin:
        return replace(skin, effects=() if effect is None else (effect,))

    others = {name: having(effect) for name, effect in rivals.items()}
    found = next_press(having(own), others, NOISE_V, FORCE_NOISE_N, feasible, "own")
    assert found is not None
    assert found["between"] == ["own", *rivals]
    assert found["reason"]
    plan_from_presses(found["press"])
    return found["press"][0]


def test_creep_or_hysteresis_asks_for_a_hold(skin: Skin) -> None:
    press = asked(skin, PiezoCreep(fraction=0.2, time_s=20.0), {"piezo_hysteresis": PiezoHysteresis(width=0.015)})
    assert press["hold_s"] > FEASIBLE.reference.hold_s


def test_relaxing_foam_or_lossy_foam_asks_for_a_hold(skin: Skin) -> None:
    own = ViscoelasticFoam(fraction=0.1, time_s=20.0)
    press = asked(skin, own, {"foam_hysteresis": FoamHysteresis(loss=0.03, reversal=0.1)})
    assert press["hold_s"] > FEASIBLE.reference.hold_s


def test_a_moving_press_asks_for_speed(skin: Skin) -> None:
    slow = replace(FEASIBLE, position_m=FEASIBLE.position_m[:1], speed_m_per_s=(2.5e-4, 1e-3))
    press = asked(skin, ScanSkew(speed_m_per_s=1e-3), {"none": None}, slow)
    assert press["speed_m_per_s"] > slow.reference.speed_m_per_s


def test_misplacement_or_inhomogeneity_asks_for_another_place(skin: Skin) -> None:
    middle = FEASIBLE.reference.position_m
    spot = PiezoInhomogeneity(amplitude=0.3, x_m=TAXELS[2, 0], y_m=TAXELS[2, 1], radius_m=0.006)
    press = asked(skin, spot, {"indenter_offset": IndenterOffset(dx_m=1e-4)})
    assert tuple(press["position_m"]) != middle
    assert np.hypot(*(np.array(press["position_m"]) - TAXELS[2])) < np.hypot(*(np.array(middle) - TAXELS[2]))


def test_no_press_tells_a_model_from_itself(skin: Skin) -> None:
    same = replace(skin, effects=(PiezoHysteresis(width=0.02),))
    assert next_press(same, {"twin": same}, NOISE_V, FORCE_NOISE_N, FEASIBLE, "own") is None
    assert next_press(same, {}, NOISE_V, FORCE_NOISE_N, FEASIBLE, "own") is None


def test_what_refitting_absorbs_does_not_count(skin: Skin) -> None:
    rival = replace(skin, effects=(PiezoInhomogeneity(amplitude=0.01, x_m=0.03, y_m=0.03, radius_m=1.0),))
    found = discrimination(skin, rival, FEASIBLE.reference, NOISE_V, FORCE_NOISE_N)
    assert found < 0.5
    assert discrimination(skin, rival, FEASIBLE.reference, 1e-3 * NOISE_V, FORCE_NOISE_N) > found


def test_foams_are_distinguished_by_force_alone_just_as_with_the_readings(
    skin: Skin, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = replace(skin, effects=(PiezoHysteresis(width=0.02), ViscoelasticFoam(fraction=0.1, time_s=20.0)))
    rival = replace(skin, effects=(PiezoHysteresis(width=0.02), FoamHysteresis(loss=0.03, reversal=0.1)))
    by_force = discrimination(own, rival, FEASIBLE.reference, NOISE_V, FORCE_NOISE_N)
    monkeypatch.setattr(design, "_read_alike", lambda skin, rival: False)
    assert by_force == pytest.approx(discrimination(own, rival, FEASIBLE.reference, NOISE_V, FORCE_NOISE_N), rel=1e-6)
    assert by_force > 1
