"""Moduli, law and contacts from pressed voltages."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.physics.calibration.contact_resistance import ContactProblem, gauss_newton
from ertskin.physics.calibration.moduli import fit_moduli, moduli_groups, with_moduli
from ertskin.physics.calibration.pressed_fit import PressedFrames, PressedProblem
from ertskin.physics.calibration.specimen import fit_specimen
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.mechanics.pressure import InterfacePressure
from ertskin.physics.mechanics.stiffness import force_n, sensor_stiffness_n_per_m
from ertskin.physics.piezo.polynomial import PiezoPolynomial
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

TRUTH_PA = np.array([60e3, 250e3])
CONTACT = np.array([950.0, 200.0, 420.0, 610.0, 150.0, 880.0, 333.0, 500.0])
NOISE, FORCE_NOISE, SUPPORT = 2e-4, 0.01, 9000.0


@pytest.fixture(scope="module")
def problem(skin: Sensor, sheet: SheetModel, protocol: Protocol) -> PressedProblem:
    """A skin whose moduli, law's zero and contacts all differ from nominal, recorded with noise."""
    rng = np.random.default_rng(11)
    stress = np.tile(np.concatenate([np.arange(0, 61), np.arange(59, -1, -1)]) * 1e3, 5)
    resistance = 18000 * (1 - 0.8 * (1 - (1 - stress / 6e4) ** 5))
    specimen = fit_specimen(
        stress,
        resistance * (1 + 0.003 * rng.standard_normal(stress.size)),
        np.arange(stress.size, dtype=float),
        np.repeat(np.arange(5), 121),
    )
    groups = moduli_groups(skin)
    truth = with_moduli(skin, groups, TRUTH_PA)
    stiffness = sensor_stiffness_n_per_m(truth)
    depth = np.tile([1e-3, 2e-3, 3e-3, 4e-3], 4)
    contact = np.repeat([[0.02, 0.02], [0.04, 0.025], [0.03, 0.04], [0.045, 0.045]], 4, axis=0)
    force = force_n(depth, stiffness, SUPPORT)
    exact = PiezoPolynomial.fit(stress, resistance).scaled(18100.0)
    pressure = InterfacePressure.from_transform(truth)

    def readings(conductivity: np.ndarray) -> np.ndarray:
        return protocol.readings(sheet.solve(conductivity, CONTACT).pair_resistance_ohm)

    pressed = np.stack(
        [
            readings(1 / exact.sheet_resistance_ohm_sq(f * pressure.at(sheet.quadrature_m - at)))
            for f, at in zip(force, contact, strict=True)
        ]
    )
    pressed += NOISE * rng.standard_normal(pressed.shape)
    rest = readings(sheet.uniform(18100.0))
    rest += NOISE / np.sqrt(20) * rng.standard_normal(rest.shape)
    weighed = force + FORCE_NOISE * rng.standard_normal(force.size)
    moduli = fit_moduli(skin, groups, depth, weighed, SUPPORT, np.repeat(np.arange(4), 4))
    contacts = gauss_newton(ContactProblem(sheet, protocol, rest, 18000.0, 10.0, True, NOISE / np.sqrt(20)))
    frames = PressedFrames(pressed, contact, weighed, rest, 20, NOISE, FORCE_NOISE)
    return PressedProblem(skin, groups, sheet, protocol, specimen, moduli, contacts, frames)


def test_voltages_tell_the_ratio_that_force_and_depth_cannot(problem: PressedProblem):
    assert abs(np.log(problem.moduli.moduli_pa[1] / TRUTH_PA[1])) > 0.25
    fit = problem.fit()
    off = np.log(fit.moduli_pa / TRUTH_PA)
    assert np.all(np.abs(off) < 3.5 * fit.log_standard_error)
    assert fit.log_standard_error[1] < 0.1
    assert fit.ratio == pytest.approx(1.0, abs=0.12)
    assert fit.rest_ratio == pytest.approx(1.0, abs=0.4)
    assert fit.law.zero_ohm_sq == pytest.approx(18100, rel=1e-3)
    assert fit.contact_resistance_ohm == pytest.approx(CONTACT, rel=0.02)


def test_derivatives_are_the_difference_quotients(problem: PressedProblem):
    from dataclasses import replace

    from ertskin.physics.calibration.pressed_fit import _State

    few = replace(
        problem.frames,
        voltage_v=problem.frames.voltage_v[:2],
        contact_m=problem.frames.contact_m[:2],
        force_n=problem.frames.force_n[:2],
        force_noise_n=0.0,
    )
    problem = PressedProblem(
        problem.sensor,
        problem.groups,
        problem.model,
        problem.protocol,
        problem.specimen,
        problem.moduli,
        problem.contacts,
        few,
    )
    softer = np.array([1e-2, 0.0])
    state = _State(np.log(problem.moduli.moduli_pa), np.zeros(6), 0.0, np.log(problem.contacts.contact_resistance_ohm))
    _, jacobian = problem._linearised(state)
    ups = [
        (0, replace(state, logs=state.logs + softer), replace(state, logs=state.logs - softer), 1e-2),
        (3, replace(state, change=10.0 * np.eye(6)[1]), replace(state, change=-10.0 * np.eye(6)[1]), 10.0),
        (8, replace(state, scale=1e-4), replace(state, scale=-1e-4), 1e-4),
        (
            11,
            replace(state, contact=state.contact + 1e-3 * np.eye(8)[2]),
            replace(state, contact=state.contact - 1e-3 * np.eye(8)[2]),
            1e-3,
        ),
    ]
    for column, up, down, step in ups:
        quotient = (problem._linearised(down)[0] - problem._linearised(up)[0]) / (2 * step)
        assert np.abs(jacobian[:, column] - quotient).max() < 0.02 * np.abs(quotient).max()
