"""Trials put together from single presses answer what the skin itself answers."""

import pickle

import numpy as np
import pytest
from test_forward import skin

from ertskin.data.forward import PressForward
from ertskin.data.trial_forward import TrialForward
from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution
from ertskin.physics.protocol import Protocol, electrode_pairs

COARSE = Resolution(2, Grading(cell_m=6e-3, rim_m=2e-3, growth=2.0))
PLACES_M = np.array([[0.02, 0.03], [0.042, 0.015], [0.033, 0.048]])
NOISE_V = 2e-3


@pytest.mark.parametrize(
    "effects",
    [None, {"sheet_anisotropy": {"stretch_x": 0.3}}, {"piezo_creep": {"fraction": 0.3, "time_s": 2.0}}],
    ids=lambda effects: next(iter(effects)) if effects else "plain",
)
def test_trials_agree_with_the_skin(effects):
    direct = PressForward(skin(effects))
    trials = TrialForward(lambda resolution: PressForward(skin(effects)), COARSE, PLACES_M, 8.0, near=COARSE)
    rng = np.random.default_rng(0)
    chosen = np.array([rng.choice(3, 2, replace=False) for _ in range(12)])
    contact, force = PLACES_M[chosen], rng.uniform(0.1, 8.0, (12, 2))
    force[:4, 1] = np.nan
    protocol = Protocol.against_sink(electrode_pairs(6), 6, 1e-4)
    error = protocol.whitened(trials.change_ohm(contact, force) - direct.change_ohm(contact, force))
    assert np.sqrt((error**2).mean()) < 0.05 * NOISE_V


def test_one_that_has_travelled_answers_the_same_bit_for_bit():
    trials = TrialForward(lambda resolution: PressForward(skin()), COARSE, PLACES_M, 8.0, near=COARSE)
    contact, force = PLACES_M[[[0, 1], [2, 1]]], np.array([[3.0, 2.0], [7.0, np.nan]])
    before = trials.change_ohm(contact, force)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(trials)).change_ohm(contact, force), before)


def test_a_contact_beside_the_sheet_changes_nothing():
    change = PressForward(skin()).change_ohm(np.array([[[3.0, 3.0]]]), np.array([[5.0]]))
    assert not change.any()


def test_presses_elsewhere_are_solved():
    direct = PressForward(skin())
    trials = TrialForward(lambda resolution: PressForward(skin()), COARSE, PLACES_M, 8.0, near=COARSE)
    contact = np.array([[[0.025, 0.031], [0.042, 0.015]], [[0.02, 0.03], [np.nan, np.nan]]])
    force = np.array([[3.0, 2.0], [9.0, np.nan]])
    np.testing.assert_array_equal(trials.change_ohm(contact, force), direct.change_ohm(contact, force))
