"""Contacts that readings hardly tell stay where contacts are."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.diagnosis.fit.layout import FARTHEST_CONTACT, MOST_OHM, Layout
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.linear.calibration_vector import SHAPE, Calibration
from ertskin.diagnosis.rest.rest_frames import FAR_FROM_GUESS, _step_at_rest
from ertskin.physics.effects.contact_drift import ContactDrift

CONTACTS = 6


def test_a_fit_keeps_contacts_near_those_at_rest() -> None:
    rested = np.array([100.0, 120.0, 80.0, 110.0, 90.0, 1e8])
    vector = Calibration(2e4, rested, 0.0, np.zeros(SHAPE)).vector()
    low, high = (np.exp(end[1 : 1 + CONTACTS]) for end in Layout((), len(vector)).bounds(rested))
    far, usual = np.exp(FARTHEST_CONTACT), np.sqrt(100.0 * 110.0)
    assert low[2] == pytest.approx(80.0 / far)
    assert high[2] == pytest.approx(usual * far)
    # One that is open may be closed again, or stay as open as any.
    assert low[-1] == pytest.approx(usual / far)
    assert high[-1] == pytest.approx(MOST_OHM)


def test_something_is_left_of_a_contact_that_wanders() -> None:
    rested = np.full(CONTACTS, 1000.0)
    vector = Calibration(2e4, rested, 0.0, np.zeros(SHAPE)).vector()
    drift = ContactDrift(2, (0.0, 10.0), (-600.0, 900.0))
    low = np.exp(Layout((Term(drift, ()),), len(vector)).bounds(rested)[0][1 : 1 + CONTACTS])
    assert low[2] == pytest.approx(600.0 + 0.5 * 400.0)
    assert (low[[0, 1, 3, 4, 5]] < 100.0).all()
    little = Term(ContactDrift(2, (0.0, 10.0), (-1.0, 1.0)), ())
    assert np.exp(Layout((little,), len(vector)).bounds(rested)[0][3]) < 100.0


def test_at_rest_they_come_back_in_reach_of_what_is_guessed_where_nothing_tells_them() -> None:
    rng = np.random.default_rng(0)
    columns, residual = np.zeros((40, CONTACTS + 1)), rng.standard_normal(40)
    columns[:, -1] = 1.0
    for begun, ended in ((5e4, 10.0 * np.exp(FAR_FROM_GUESS)), (500.0, 500.0)):
        logs = np.log(np.full(CONTACTS, begun))
        for _ in range(40):
            logs = logs + _step_at_rest(columns, residual, logs, np.log(10.0))[:-1]
        np.testing.assert_allclose(np.exp(logs), ended, rtol=1e-3)


def test_at_rest_readings_that_tell_them_count_more_than_the_guess() -> None:
    rng = np.random.default_rng(1)
    columns = rng.standard_normal((40, CONTACTS + 1))
    logs, true = np.log(np.full(CONTACTS, 10.0)), np.log(np.linspace(200.0, 700.0, CONTACTS))
    noise = 1e-3 * rng.standard_normal(40)
    for _ in range(20):
        logs = logs + _step_at_rest(columns, columns[:, :-1] @ (true - logs) + noise, logs, np.log(10.0))[:-1]
    np.testing.assert_allclose(logs, true, atol=3e-3)


def test_at_rest_one_that_is_open_leaves_the_others_where_they_are() -> None:
    rng = np.random.default_rng(2)
    columns = 1e-3 * rng.standard_normal((40, CONTACTS + 1))
    columns[:, -2:] = rng.standard_normal((40, 2))
    logs = np.log([100.0] * (CONTACTS - 1) + [1e6])
    residual = rng.standard_normal(40)
    residual -= columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]
    for _ in range(30):
        logs = logs + _step_at_rest(columns, residual, logs, np.log(10.0))[:-1]
    np.testing.assert_allclose(logs[:-1], np.log(100.0), atol=0.05)
