"""The trials' forward model answers what the whole skin answers, and remembers nothing between presses."""

import pickle

import numpy as np
import pytest
from small_skin import SMALL, small_law, small_sensor

from ertskin.data.forward import PressForward
from ertskin.physics.effects.registry import build_effects
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

PRESSES_M = np.array(
    [[[0.02, 0.03], [np.nan, np.nan]], [[0.02, 0.03], [0.042, 0.015]], [[0.033, 0.041], [0.011, 0.01]]]
)
FORCES_N = np.array([[3.0, np.nan], [4.0, 1.5], [0.5, 8.0]])


def skin(effects=None):
    protocol = Protocol.against_sink(electrode_pairs(6), 6, 1e-4)
    built = build_effects(effects or {})
    return Skin.build(small_sensor(), protocol, small_law(), np.full(6, 300.0), effects=built, resolution=SMALL)


def lone_presses(times_s):
    """Each press by itself: a rest frame, then frames of the same press at ``times_s``."""
    for place, force in zip(PRESSES_M, FORCES_N, strict=True):
        count = len(times_s)
        yield History(
            np.r_[0.0, times_s],
            np.zeros(count + 1, dtype=np.int64),
            np.r_[0, np.ones(count)].astype(np.uint8),
            np.concatenate([np.full((1, 2, 2), np.nan), np.repeat(place[None], count, axis=0)]),
            np.full((count + 1, 2), np.nan),
            np.concatenate([np.full((1, 2), np.nan), np.repeat(force[None], count, axis=0)]),
        )


@pytest.mark.parametrize(
    "effects",
    [
        None,
        {"sheet_anisotropy": {"stretch_x": 0.3}},
        {"contact_pressure_dependence": {"sensitivity_per_pa": 1e-4}},
        {"piezo_creep": {"fraction": 0.3, "time_s": 2.0}},
    ],
    ids=lambda effects: next(iter(effects)) if effects else "plain",
)
def test_answers_as_the_whole_skin_does(effects):
    whole = skin(effects)
    found = PressForward(whole, dwell_s=1.0).change_ohm(PRESSES_M, FORCES_N)
    expected = []
    for history in lone_presses(np.array([1e-3, 1.0])):
        resistance = whole.pair_resistance_ohm(history)
        expected.append(resistance[-1] - resistance[0])
    # A contact's far tail, 2e-4 of its peak, is left out where another contact presses.
    away = np.linalg.norm(found - expected, axis=1) / np.linalg.norm(expected, axis=1)
    assert away[0] < 1e-9
    assert away.max() < 3e-3


def test_order_and_company_of_the_presses_do_not_matter():
    forward = PressForward(skin())
    together = forward.change_ohm(PRESSES_M, FORCES_N)
    alone = PressForward(skin()).change_ohm(PRESSES_M[::-1], FORCES_N[::-1])[::-1]
    assert np.array_equal(together, alone)
    travelled = pickle.loads(pickle.dumps(forward))
    assert np.array_equal(travelled.change_ohm(PRESSES_M[:1], FORCES_N[:1]), together[:1])


def test_a_load_cell_in_air_presses_nothing():
    nothing = PressForward(skin()).change_ohm(np.full((2, 1, 2), np.nan), np.array([[0.007], [np.nan]]))
    assert not nothing.any()


def test_a_skin_that_its_scans_have_warmed_is_pressed_warm():
    whole = skin({"self_heating": {"crowded_rise": -0.1, "lasts_s": 5.0}})
    found = PressForward(whole).change_ohm(PRESSES_M[:1], FORCES_N[:1])[0]
    rests = 60
    history = History(
        np.arange(rests + 2.0),
        np.zeros(rests + 2, dtype=np.int64),
        np.r_[np.zeros(rests), 1, 1].astype(np.uint8),
        np.concatenate([np.full((rests, 2, 2), np.nan), np.repeat(PRESSES_M[:1], 2, axis=0)]),
        np.full((rests + 2, 2), np.nan),
        np.concatenate([np.full((rests, 2), np.nan), np.repeat(FORCES_N[:1], 2, axis=0)]),
    )
    resistance = whole.pair_resistance_ohm(history, wanted=np.array([rests - 1, rests + 1]))
    expected = resistance[1] - resistance[0]
    assert np.linalg.norm(found - expected) < 1e-3 * np.linalg.norm(expected)
    cold = PressForward(skin()).change_ohm(PRESSES_M[:1], FORCES_N[:1])[0]
    assert np.linalg.norm(cold - expected) > 0.01 * np.linalg.norm(expected)
