"""The resting skin followed on a virtual one whose contacts and sheet drift by known amounts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from ertskin.physics.calibration.following import RestingSkin, RestState, followed, surprises
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import Sensor

NOISE_V = 5e-5
SHEET_OHM, CONTACT_OHM = 2e3, 300.0
STEP_S = 60.0


@dataclass
class VirtualSkin:
    """Whitened coordinates of a sheet with eight electrodes, pressed or not, at any contacts and sheet resistance."""

    def __post_init__(self) -> None:
        grid = [(x, y) for x in (0.008, 0.04, 0.072) for y in (0.008, 0.04, 0.072) if (x, y) != (0.04, 0.04)]
        outline = np.array([[0.0, 0.0], [0.08, 0.0], [0.08, 0.08], [0.0, 0.08]])
        sensor = Sensor(outline_m=outline, electrode_center_m=np.array(grid), electrode_size_m=np.full((8, 2), 4e-3))
        self.model = SheetModel(sensor, "fast")
        self.protocol = Protocol.against_sink(electrode_pairs(8), 8, 1e-4)

    def reads(self, sheet: float, contact: np.ndarray, pressed: float = 0.0) -> np.ndarray:
        """(n,) with sheet and contacts changed by these shares, and a place made that much more conductive."""
        away2 = ((self.model.quadrature_m - [0.03, 0.045]) ** 2).sum(axis=2)
        conductivity = (1.0 + pressed * np.exp(-0.5 * away2 / 5e-3**2)) / (SHEET_OHM * (1.0 + sheet))
        solution = self.model.solve(conductivity, CONTACT_OHM * (1.0 + contact))
        return self.protocol.whitened(solution.pair_resistance_ohm)

    def slopes(self) -> np.ndarray:
        solution = self.model.solve(self.model.uniform(SHEET_OHM), np.full(8, CONTACT_OHM))
        by_contact = solution.jacobian_contact_resistance() * CONTACT_OHM
        by_sheet = solution.pair_resistance_ohm - by_contact.sum(axis=1)
        return self.protocol.whitened(np.column_stack([by_contact, by_sheet]).T).T


@pytest.fixture(scope="module")
def skin() -> VirtualSkin:
    return VirtualSkin()


@pytest.fixture(scope="module")
def calibrated(skin) -> RestingSkin:
    """Learned on forty quiet rest frames."""
    rng = np.random.default_rng(0)
    rest = skin.reads(0.0, np.zeros(8)) + NOISE_V * rng.standard_normal((40, 28))
    return RestingSkin.learned(rest, STEP_S * np.arange(40.0), skin.slopes(), NOISE_V)


def drifts(count: int = 61) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, and shares by which a sheet warms and contacts wander over an hour: 6 %, up to 15 %."""
    rng = np.random.default_rng(1)
    share = np.linspace(0.0, 1.0, count)
    return STEP_S * np.arange(count), -0.06 * share, share[:, None] * rng.uniform(-0.15, 0.15, 8)


def test_a_press_reads_as_at_the_calibration_where_zeroing_alone_leaves_the_drift(skin, calibrated):
    """A rest frame every two minutes, a press right after it: its error with zeroing alone and with following."""
    time_s, sheet, contact = drifts()
    rng = np.random.default_rng(2)
    state, errors = RestState.unknown(calibrated, 0.0), []
    reference = skin.reads(0.0, np.zeros(8), 0.5) - skin.reads(0.0, np.zeros(8))
    for k in range(0, 60, 2):
        rest = skin.reads(sheet[k], contact[k]) + NOISE_V * rng.standard_normal(28)
        state = state.at(time_s[k]).updated(rest)
        pressed = skin.reads(sheet[k], contact[k], 0.5) + NOISE_V * rng.standard_normal(28)
        now = state.at(time_s[k] + 1.0)
        zeroed, corrected = pressed - rest, (pressed - now.zero_v) / now.gain
        errors.append([np.linalg.norm(change - reference) for change in (zeroed, corrected)])
    zeroing, following = (np.array(errors)[-10:] / np.linalg.norm(reference)).mean(axis=0)
    assert zeroing > 0.05
    assert following < 0.02
    assert state.gain - 1.0 == pytest.approx(sheet[58], abs=1e-3)
    np.testing.assert_allclose(state.change[:-1], contact[58], atol=0.01)


def test_rest_frames_before_and_after_tell_more(skin, calibrated):
    time_s, sheet, contact = drifts()
    rng = np.random.default_rng(3)
    rest = np.array([skin.reads(sheet[k], contact[k]) for k in range(0, 61, 6)])
    noisy = rest + NOISE_V * rng.standard_normal(rest.shape)
    between = time_s[3::6]
    states = followed(calibrated, noisy, time_s[::6], between)
    gain = np.array([state.gain for state in states])
    np.testing.assert_allclose(gain - 1.0, sheet[3::6], atol=5e-4)
    true = np.array([skin.reads(sheet[k], contact[k]) for k in range(3, 61, 6)])
    error = np.array([state.zero_v for state in states]) - true
    stated = np.array([state.zero_variance for state in states])
    assert np.mean(error**2) / NOISE_V**2 < 1.5 * stated.mean()


def test_a_steady_touch_stays_a_touch(skin, calibrated):
    """Held for an hour while the skin drifts: never at rest, and at rest again once it is let go."""
    time_s, sheet, contact = drifts()
    rng = np.random.default_rng(4)
    state = RestState.unknown(calibrated, 0.0)
    for k in range(5):
        state = state.at(float(k)).updated(skin.reads(0.0, np.zeros(8)) + NOISE_V * rng.standard_normal(28))
    for k in range(1, 61):
        held = skin.reads(sheet[k], contact[k], 0.1) + NOISE_V * rng.standard_normal(28)
        assert state.at(time_s[k]).loosened().surprise(held) > calibrated.limit
    let_go = skin.reads(sheet[60], contact[60]) + NOISE_V * rng.standard_normal(28)
    assert state.at(time_s[60]).loosened().surprise(let_go) < calibrated.limit


def test_rest_frames_are_taken_for_strange_as_often_as_stated(skin, calibrated):
    rng = np.random.default_rng(5)
    rest = skin.reads(0.01, np.full(8, 0.02)) + NOISE_V * rng.standard_normal((1500, 28))
    seen = np.array([square for square, _ in surprises(calibrated, rest, 0.5 * np.arange(1500.0))])
    assert (seen > calibrated.limit).mean() <= 4e-3
    assert 0.7 < seen.mean() < 1.05  # the least rates allow for more than a skin that stands still shows
    assert (
        RestState.unknown(calibrated, 0.0).updated(rest[0]).at(1.0).surprise(skin.reads(0.0, np.full(8, 0.0), 0.3))
        > 3 * calibrated.limit
    )


def test_rates_are_those_of_the_calibration(skin):
    """A sheet that wanders by 5 % in the root of an hour, and contacts that jitter by 3 % from scan to scan."""
    rng = np.random.default_rng(6)
    sheet = np.cumsum(0.05 * np.sqrt(STEP_S / 3600.0) * rng.standard_normal(60))
    slopes, quiet = skin.slopes(), skin.reads(0.0, np.zeros(8))
    change = np.column_stack([0.03 * rng.standard_normal((60, 8)), sheet])
    rest = quiet + change @ slopes.T + NOISE_V * rng.standard_normal((60, 28))
    learned = RestingSkin.learned(rest, STEP_S * np.arange(60.0), slopes, NOISE_V)
    assert learned.sheet_rate * 60.0 == pytest.approx(0.05, rel=0.4)
    assert learned.jitter == pytest.approx(0.03, rel=0.3)
    few = RestingSkin.learned(rest[:2], STEP_S * np.arange(2.0), slopes, NOISE_V)
    assert few.sheet_rate < 0.02


def test_nothing_known_of_contacts_still_follows_the_zero():
    rng = np.random.default_rng(7)
    unknown = RestingSkin.learned(rng.standard_normal((20, 6)), np.arange(20.0), np.zeros((6, 0)), 1.0)
    state = RestState.unknown(unknown, 0.0)
    for k in range(50):
        state = state.at(float(k)).updated(3.0 + rng.standard_normal(6))
    assert state.gain == 1.0
    np.testing.assert_allclose(state.zero_v, 3.0, atol=0.6)
    with pytest.raises(ValueError, match="no rest frame"):
        followed(unknown, np.zeros((0, 6)), np.zeros(0), np.zeros(1))


def test_what_neither_contacts_nor_sheet_explain_is_no_more_than_the_surprise(skin, calibrated):
    rng = np.random.default_rng(5)
    state = RestState.unknown(calibrated, 0.0).updated(skin.reads(0.0, np.zeros(8))).at(30.0)
    for pressed in (0.0, 0.01, 0.3):
        frame = skin.reads(1e-3, 1e-2 * rng.standard_normal(8), pressed) + NOISE_V * rng.standard_normal(28)
        assert 0.0 < state.unexplained(frame) <= state.surprise(frame)
    assert state.unexplained(frame) > calibrated.limit
