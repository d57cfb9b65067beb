"""A press that moves during its scan is expected to gain what its fit does: by the scans and beyond any network."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_skin import FOUR_PRESSES, SMALL, four_presses, small_law, small_sensor

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.linear.calibration_vector import SHAPE, Calibration, SkinFamily
from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.diagnosis.search.candidates import screen
from ertskin.physics.effects.scan_skew import ScanSkew
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

CHANNELS, NOISE_V = 6, 1e-5
SCAN = replace(
    Protocol.against_sink(electrode_pairs(CHANNELS), CHANNELS, 1e-4), injection_offset_s=np.linspace(0.0, 0.4, 15)
)
CONTACT_OHM = np.linspace(200.0, 900.0, CHANNELS)
START = Calibration(9000.0, CONTACT_OHM, 0.0, np.zeros(SHAPE))
PARTITIONS = [[k] for k in range(FOUR_PRESSES)]


def recorded(*effects: ScanSkew) -> VoltageProblem:
    """The fit of readings taken while the stage moves by the effects, or stands still."""
    skin = Skin.build(small_sensor(), SCAN, small_law(), CONTACT_OHM, 9000.0, (), SMALL)
    seen = four_presses()
    linear = LinearSkin(skin, seen, np.nan_to_num(skin.force_n(seen)), np.arange(len(seen)), None)
    basis, shape = SCAN.orthonormal, (len(seen), *SCAN.shape)

    def problem(readings: np.ndarray) -> VoltageProblem:
        flat = readings.reshape(len(seen), -1)
        scan = flat @ basis
        evidence = Evidence(
            skin.sensor, SCAN, seen, scan, (flat - scan @ basis.T).reshape(shape).astype(np.float32), NOISE_V, NOISE_V,
            float("nan"), None, np.zeros((scan.shape[1], 0)), np.zeros((*scan.shape, 0)),
            1 - scan.shape[1] / flat.shape[1], np.zeros(CHANNELS, dtype=np.intp),
        )  # fmt: skip
        return VoltageProblem(evidence, SkinFamily(skin, "fast"), linear, None, seen.press, np.ones(len(seen)))

    still = problem(np.zeros(shape))
    assert len(still.acquisition.rows) == len(seen)
    readings = still.acquisition.readings(replace(skin, effects=effects))
    return problem(readings + NOISE_V * np.random.default_rng(0).standard_normal(shape))


def expected(problem: VoltageProblem) -> tuple[float, float, ScanSkew | None]:
    """What screening expects a moving press to gain, what of that no network explains, and where its fit begins."""
    solved = problem.solve([], START)
    found = [c for c in screen(problem, solved, PARTITIONS) if c.name == ScanSkew.name]
    return (found[0].gain, found[0].beyond, found[0].term.effect) if found else (0.0, 0.0, None)


@pytest.mark.parametrize("at_s", [0.0, 0.2, 0.4])
def test_a_moving_press_is_expected_to_gain_what_its_fit_gains(at_s: float) -> None:
    problem = recorded(ScanSkew(3e-4, at_s))
    gain, beyond, begun = expected(problem)
    solved = problem.solve([], START, leftover=True)
    terms = [c.term for c in screen(problem, solved, PARTITIONS) if c.name == ScanSkew.name][:1]
    fit = problem.solve(terms, START, leftover=True)
    assert begun is not None
    assert begun.speed_m_per_s == pytest.approx(3e-4, rel=0.5)
    assert gain == pytest.approx(solved.cost - fit.cost, rel=0.3)
    assert 0 < beyond < gain
    assert fit.effects[0].speed_m_per_s == pytest.approx(3e-4, rel=0.05)


def test_a_press_that_stands_still_gains_nothing_by_moving() -> None:
    gain, _, _ = expected(recorded())
    assert gain < 10.0
