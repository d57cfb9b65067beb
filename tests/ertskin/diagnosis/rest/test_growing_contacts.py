"""Contacts that grow many times over are followed on the sheet solved in full, not by the slope at the mean."""

from __future__ import annotations

import numpy as np
import pytest
from small_skin import SMALL, small_law, small_sensor, undriven

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.rest.growing_contacts import grown
from ertskin.diagnosis.rest.rest_frames import _scan_at_rest, fitted_at_rest
from ertskin.diagnosis.rest.settling_contacts import Settling
from ertskin.diagnosis.rest.wandering_contacts import contact_drift
from ertskin.physics.skin import Skin

CONTACTS, ELECTRODE = 6, 2
TIME_S = 30.0 * np.arange(14)
COURSE = np.log1p(TIME_S / 20.0) - np.log1p(TIME_S / 20.0).mean()
WAY = (COURSE - COURSE[0]) / np.ptp(COURSE)


@pytest.fixture(scope="module")
def skin() -> Skin:
    return Skin.build(small_sensor(), undriven(), small_law(), np.full(CONTACTS, 400.0), 9000.0, (), SMALL)


def scans_of(skin: Skin, ohm: np.ndarray, noise_v: float, level: float = 0.01) -> np.ndarray:
    """(R,P) scans while one contact takes the values (R,) and the whole sheet does as it likes."""
    rng = np.random.default_rng(4)
    contacts = np.full((len(ohm), CONTACTS), 400.0)
    contacts[:, ELECTRODE] = ohm
    scans = np.array([_scan_at_rest(skin, row)[0] for row in contacts])
    sheet = 1 + level * rng.standard_normal((len(ohm), 1))
    return sheet * scans + noise_v * rng.standard_normal(scans.shape)


@pytest.mark.parametrize(("first", "last"), [(300.0, 9300.0), (4000.0, 250.0), (300.0, 900.0)])
@pytest.mark.parametrize("size", [{ELECTRODE: 0.5}, {ELECTRODE: 0.5, 4: 0.01}])
def test_a_contact_that_goes_far_is_followed_and_the_mean_stays(
    skin: Skin, first: float, last: float, size: dict[int, float]
) -> None:
    true_ohm, noise_v = first + (last - first) * WAY, 1e-4
    scans = scans_of(skin, true_ohm, noise_v, 0.0)
    mean, columns, _ = fitted_at_rest(skin, scans.mean(axis=0))

    def scan_of(ohm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        scan, slope = _scan_at_rest(mean, ohm)
        return scan / noise_v, slope / noise_v

    contacts = np.array(mean.contact_resistance_ohm)
    change = (scans - scans.mean(axis=0)) / noise_v
    relative, made = grown(Settling(size, COURSE, 1.0), change, columns[:, -1], contacts, scan_of)
    np.testing.assert_allclose(contacts[ELECTRODE] * relative[ELECTRODE], true_ohm, rtol=0.25)
    for other in set(size) - {ELECTRODE}:
        np.testing.assert_allclose(relative[other], 1.0, atol=0.1)
    level = columns[:, -1] / np.linalg.norm(columns[:, -1])
    left = change - made
    left -= np.outer(left @ level, level)
    assert np.abs(left.mean(axis=0)).max() < 4.0


@pytest.mark.parametrize("noise_v", [2e-4, 1e-4, 3e-5])
def test_what_goes_far_is_found_however_well_it_is_told(skin: Skin, noise_v: float) -> None:
    scans = scans_of(skin, 300.0 + 1500.0 * WAY, noise_v, 0.0)
    mean, columns, _ = fitted_at_rest(skin, scans.mean(axis=0))
    contacts, traces = np.array(mean.contact_resistance_ohm), np.zeros((len(TIME_S), scans.shape[1], 3))

    def scan_of(ohm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _scan_at_rest(mean, ohm)

    given = noise_v, columns, traces, contacts, DEFAULT, scan_of
    found = contact_drift(scans - scans.mean(axis=0), TIME_S, np.arange(len(TIME_S)), *given)
    drifts = {getattr(drift, "electrode", None): np.array(getattr(drift, "ohm", ())) for drift in found.effects}
    assert ELECTRODE in drifts
    np.testing.assert_allclose(found.usual_ohm[ELECTRODE] + drifts[ELECTRODE], 300.0 + 1500.0 * WAY, rtol=0.25)
