"""The bench's sheet against closed forms, itself at other resolutions, and the model it is meant to test."""

import numpy as np
import pytest

from ertskin.hardware.virtual.bench.nominal import nominal_protocol, nominal_sensor
from ertskin.hardware.virtual.bench.sheet import SpectralSheet, gauss_lobatto, graded_lines
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.protocol import pair_resistances

SHEET_OHM = 18e3
CONTACT_OHM = np.random.default_rng(1).uniform(200.0, 1000.0, 24)


def strip() -> SpectralSheet:
    """A strip 60 mm x 10 mm with pads 5 mm long across both its ends."""
    center, size = np.array([[2.5e-3, 5e-3], [57.5e-3, 5e-3]]), np.array([[5e-3, 1e-2]] * 2)
    return SpectralSheet((0.06, 0.01), center, size, degree=8, largest_m=2.5e-3)


def nominal_sheet(degree: int = 8, largest_m: float = 4.6e-3) -> SpectralSheet:
    sensor = nominal_sensor()
    return SpectralSheet((0.12, 0.12), sensor.electrode_center_m, sensor.electrode_size_m, degree, largest_m)


def dented(sheet: SpectralSheet, center_m: tuple[float, float]) -> np.ndarray:
    """Conductivity that quadruples smoothly at one place."""
    distance = np.hypot(*np.moveaxis(sheet.points_m - center_m, -1, 0))
    return (1 + 3 * np.exp(-((distance / 5e-3) ** 2))) / SHEET_OHM


def readings(transfer_ohm: np.ndarray) -> np.ndarray:
    return nominal_protocol(nominal_sensor()).readings(pair_resistances(transfer_ohm))


def test_lobatto_rule_integrates_and_differentiates_polynomials_exactly():
    x, weight, derivative = gauss_lobatto(6)
    assert weight @ x**10 == pytest.approx(2 / 11, rel=1e-13)
    np.testing.assert_allclose(derivative @ x**6, 6 * x**5, atol=1e-12)


def test_lines_pass_through_every_rim():
    lines = graded_lines(0.1, np.array([0.013, 0.017]), 0.01)
    assert {0.0, 0.013, 0.017, 0.1} <= set(lines.round(12).tolist())
    assert np.diff(lines).max() <= 0.01 + 1e-12


def test_strip_has_the_resistance_of_a_transmission_line():
    contact = np.array([300.0, 700.0])
    sheet = strip()
    transfer = sheet.factor(np.full(sheet.points_m.shape[:2], 1 / SHEET_OHM), contact).transfer_ohm
    impedance = contact * 5e-5
    depth = np.sqrt(impedance / SHEET_OHM)
    ends = np.sqrt(impedance * SHEET_OHM) / 1e-2 / np.tanh(5e-3 / depth)
    assert pair_resistances(transfer)[0] == pytest.approx(SHEET_OHM * 0.05 / 0.01 + ends.sum(), rel=1e-7)


def test_oblique_grain_in_a_strip_conducts_as_the_inverse_of_its_resistivity():
    sheet = strip()
    angle, contact = 0.6, np.array([1e-3, 1e-3])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    tensor = turn @ np.diag([1.3, 1 / 1.3]) @ turn.T / SHEET_OHM
    grain = np.array([tensor[0, 0], tensor[1, 1], tensor[0, 1]])
    ones = np.full(sheet.points_m.shape[:2], 1.0)
    whole = pair_resistances(sheet.factor(ones[..., None] * grain, contact).transfer_ohm)[0]
    lengthwise = pair_resistances(sheet.factor(ones * tensor[0, 0], contact).transfer_ohm)[0]
    across_free = pair_resistances(sheet.factor(ones / np.linalg.inv(tensor)[0, 0], contact).transfer_ohm)[0]
    assert lengthwise < whole < across_free


def test_local_change_equals_a_new_elimination():
    sheet = nominal_sheet(6)
    conductivity = dented(sheet, (0.05, 0.03))
    reference = sheet.factor(np.full_like(conductivity, 1 / SHEET_OHM), CONTACT_OHM)
    element = np.flatnonzero((np.abs(conductivity * SHEET_OHM - 1) > 1e-12).any(axis=1))
    assert len(element) < sheet.elements
    changed = reference.changed(element, conductivity[element]).transfer_ohm
    np.testing.assert_allclose(changed, sheet.factor(conductivity, CONTACT_OHM).transfer_ohm, rtol=0, atol=1e-6)


def test_transfer_is_symmetric_and_mean_free():
    sheet = nominal_sheet(6)
    transfer = sheet.factor(dented(sheet, (0.03, 0.07)), CONTACT_OHM).transfer_ohm
    np.testing.assert_allclose(transfer, transfer.T, atol=1e-8)
    np.testing.assert_allclose(transfer.sum(axis=0), 0.0, atol=1e-7)


def test_error_at_two_resolutions_lies_far_below_the_noise():
    """5 microvolt is 0.0025 of the noise in the readings, 0.012 in the 276 numbers."""
    place = (0.05, 0.03)
    volts = []
    for degree, largest in ((8, 4.6e-3), (11, 3.6e-3)):
        sheet = nominal_sheet(degree, largest)
        volts.append(readings(sheet.factor(dented(sheet, place), CONTACT_OHM).transfer_ohm))
    assert np.sqrt(np.mean((volts[0] - volts[1]) ** 2)) < 5e-6


def test_agrees_with_the_model_it_is_meant_to_test():
    sheet, model = nominal_sheet(), SheetModel(nominal_sensor())
    bench = sheet.factor(np.full(sheet.points_m.shape[:2], 1 / SHEET_OHM), CONTACT_OHM).transfer_ohm
    solution = model.solve(np.full(model.quadrature_m.shape[:2], 1 / SHEET_OHM), CONTACT_OHM)
    model_v = nominal_protocol(nominal_sensor()).readings(solution.pair_resistance_ohm)
    assert np.sqrt(np.mean((readings(bench) - model_v) ** 2)) < 1e-4


def test_a_conductivity_that_is_not_positive_is_refused():
    sheet = strip()
    with pytest.raises(np.linalg.LinAlgError, match="positive"):
        sheet.factor(np.full(sheet.points_m.shape[:2], -1.0), np.array([1.0, 1.0]))
