"""The discrepancy of a model is learned from noisy presses and predicts forces it hasn't seen."""

import numpy as np
import pytest

from ertskin.data.discrepancy import Discrepancy

PLACES = np.array([[0.01, 0.01], [0.03, 0.01], [0.05, 0.01]])
COORDINATES = 12
NOISE_V = 2e-3
REACH_M = 5e-3


def truth(place, force):
    shape = np.sin(np.outer(np.arange(1, COORDINATES + 1), place + 1.0))
    return (0.05 * np.tanh(force / 3)[None] * shape).T


def presses(forces, seed=0, drift_v=0.0):
    place = np.repeat(np.arange(len(PLACES)), len(forces))
    force = np.tile(forces, len(PLACES))
    rng = np.random.default_rng(seed)
    noise = NOISE_V * rng.standard_normal((len(force), COORDINATES))
    noise[:, 0] += drift_v * rng.standard_normal(len(force))
    return PLACES[place], force, np.outer(force, np.ones(COORDINATES)), truth(place, force) + noise


def covariance(drift_v=0.0):
    found = NOISE_V**2 * np.eye(COORDINATES)
    found[0, 0] += drift_v**2
    return found


@pytest.mark.parametrize("drift_v", [0.0, 0.2])
def test_predicts_unseen_forces_within_the_noise(drift_v):
    found = Discrepancy.fit(*presses(np.arange(1.0, 10.0), drift_v=drift_v), covariance(drift_v), REACH_M)
    place = np.repeat(np.arange(3), 8)
    force = np.tile(np.arange(1.5, 9.0), 3)
    error = found.of(PLACES[place][:, None], force[:, None]) - truth(place, force)
    assert np.sqrt(np.mean(error[:, 1:] ** 2)) < NOISE_V
    assert np.sqrt(np.mean(truth(place, force) ** 2)) > 10 * NOISE_V


def test_several_contacts_add_up_and_absent_or_far_ones_add_nothing():
    found = Discrepancy.fit(*presses(np.arange(1.0, 10.0)), covariance(), REACH_M)
    both = found.of(PLACES[None, :2], np.array([[2.0, 5.0]]))
    single = [found.of(PLACES[None, k : k + 1], np.array([[force]])) for k, force in ((0, 2.0), (1, 5.0))]
    assert both == pytest.approx(single[0] + single[1])
    absent = np.array([[PLACES[0], [np.nan, np.nan]]])
    assert found.of(absent, np.array([[2.0, np.nan]])) == pytest.approx(single[0])
    assert not found.of(PLACES[None, :1] + 0.01, np.array([[2.0]])).any()
    assert not found.of(PLACES[None, :1], np.array([[0.0]])).any()


def test_a_perfect_model_is_left_nearly_alone():
    place, force, simulated, residual = presses(np.arange(1.0, 10.0))
    number = np.repeat(np.arange(3), 9)
    found = Discrepancy.fit(place, force, simulated, residual - truth(number, force), covariance(), REACH_M)
    assert np.sqrt(np.mean(found.of(place[:, None], force[:, None]) ** 2)) < 0.5 * NOISE_V


def test_noise_leaves_no_mark_that_tells_the_force():
    place, force, simulated, residual = presses(np.arange(1.0, 10.0))
    found = Discrepancy.fit(place, force, simulated, residual, covariance(), REACH_M)
    number = np.repeat(np.arange(3), 9)
    error = found.of(place[:, None], force[:, None]) - truth(number, force)
    assert np.linalg.norm(error[:9], axis=1).max() < 0.8 * NOISE_V * np.sqrt(COORDINATES)
