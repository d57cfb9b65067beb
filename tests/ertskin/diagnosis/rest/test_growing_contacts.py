"""Contacts that grow many times over are followed on the sheet solved in full, not by the slope at the mean."""

from __future__ import annotations

import numpy as np
import pytest
from small_skin import SMALL, small_law, small_sensor

from ertskin.diagnosis.rest.growing_contacts import grown
from ertskin.diagnosis.rest.rest_frames import _scan_at_rest, fitted_at_rest
from ertskin.diagnosis.rest.settling_contacts import Settling
from ertskin.physics.protocol import Protocol
from ertskin.physics.skin import Skin

CONTACTS, ELECTRODE = 6, 2
TIME_S = 30.0 * np.arange(14)
COURSE = np.log1p(TIME_S / 20.0) - np.log1p(TIME_S / 20.0).mean()
LEVEL_SCATTER = 0.01


def undriven() -> Protocol:
    """Every pair drives, neighbours are read, none of them at a driven electrode."""
    driving = np.stack(np.triu_indices(CONTACTS, 1), axis=1)
    reading = np.stack([np.arange(CONTACTS), np.roll(np.arange(CONTACTS), -1)], axis=1)
    current_a = np.eye(CONTACTS)[driving[:, 0]] - np.eye(CONTACTS)[driving[:, 1]]
    apart = ~(driving[:, None, :, None] == reading[None, :, None, :]).any(axis=(2, 3))
    scan = Protocol.differences(1e-3 * current_a, reading)
    return Protocol(scan.injection_current_a, scan.measurement, measured=apart)


@pytest.fixture(scope="module")
def skin() -> Skin:
    return Skin.build(small_sensor(), undriven(), small_law(), np.full(CONTACTS, 400.0), 9000.0, (), SMALL)


def scans_of(skin: Skin, ohm: np.ndarray, noise_v: float) -> np.ndarray:
    """(R,P) scans while one contact takes the values (R,) and the whole sheet does as it likes."""
    rng = np.random.default_rng(4)
    contacts = np.full((len(ohm), CONTACTS), 400.0)
    contacts[:, ELECTRODE] = ohm
    scans = np.array([_scan_at_rest(skin, row)[0] for row in contacts])
    sheet = 1 + LEVEL_SCATTER * rng.standard_normal((len(ohm), 1))
    return sheet * scans + noise_v * rng.standard_normal(scans.shape)


def test_a_contact_that_grows_thirtyfold_is_followed(skin: Skin) -> None:
    way = (COURSE - COURSE[0]) / np.ptp(COURSE)
    true_ohm, noise_v = 300.0 + 9000.0 * way, 2e-4
    scans = scans_of(skin, true_ohm, noise_v)
    mean, columns, _ = fitted_at_rest(skin, scans.mean(axis=0))

    def scan_of(ohm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        scan, slope = _scan_at_rest(mean, ohm)
        return scan / noise_v, slope / noise_v

    contacts = np.array(mean.contact_resistance_ohm)
    change = (scans - scans.mean(axis=0)) / noise_v
    relative = grown(Settling({ELECTRODE: 0.5}, COURSE, 1.0), change, columns[:, -1], contacts, scan_of)
    np.testing.assert_allclose(contacts[ELECTRODE] * relative[ELECTRODE], true_ohm, rtol=0.2)
