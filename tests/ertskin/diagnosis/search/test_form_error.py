"""The nameless part of an instrument's effect: channels that differ are its form's error, a sheet is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_skin import FOUR_PRESSES, SMALL, four_presses, small_law, small_sensor

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.linear.calibration_vector import SHAPE, Calibration, SkinFamily
from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.diagnosis.search.first_order_gain import held_out_gains
from ertskin.diagnosis.search.form_error import _other_forms, form_error
from ertskin.physics.effects.crosstalk import Crosstalk
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

CHANNELS, NOISE_V = 6, 1e-5
SCAN = Protocol.against_sink(electrode_pairs(CHANNELS), CHANNELS, 1e-4)
CONTACT_OHM = np.linspace(200.0, 900.0, CHANNELS)
START = Calibration(9000.0, CONTACT_OHM, 0.0, np.zeros(SHAPE))
SHARES = 4e-3 * np.array([0.4, 1.8, 0.2, 1.0, 1.5, 0.6])
PARTITIONS = [[k] for k in range(FOUR_PRESSES)]
TERM = Term(Crosstalk(fraction=4e-3), ("fraction",))


def fitted(shares: np.ndarray, sheet: SheetAnisotropy | None = None) -> tuple[VoltageProblem, Solved]:
    """A fit with one crosstalk of readings of which each channel keeps its own share (M,), on a sheet."""
    skin = Skin.build(small_sensor(), SCAN, small_law(), CONTACT_OHM, 9000.0, (), SMALL)
    seen = four_presses()
    force_n = np.nan_to_num(skin.force_n(seen))
    linear = LinearSkin(skin, seen, force_n, np.arange(len(seen)), None)
    basis = SCAN.orthonormal
    true = replace(skin, effects=() if sheet is None else (sheet,))
    still = (linear.scans(true) @ basis.T).reshape(-1, *SCAN.shape)
    rng = np.random.default_rng(0)
    readings = still + NOISE_V * rng.standard_normal(still.shape)
    for channel, share in enumerate(shares):
        readings += Crosstalk(fraction=share, channel=channel).distorted_v(still, SCAN) - still
    flat = readings.reshape(len(seen), -1)
    scan = flat @ basis
    evidence = Evidence(
        skin.sensor, SCAN, seen, scan, (flat - scan @ basis.T).reshape(readings.shape).astype(np.float32), NOISE_V,
        NOISE_V, float("nan"), None, np.zeros((scan.shape[1], 0)), np.zeros((*scan.shape, 0)),
        1 - scan.shape[1] / flat.shape[1], np.zeros(CHANNELS, dtype=np.intp),
    )  # fmt: skip
    problem = VoltageProblem(evidence, SkinFamily(skin, "fast"), linear, None, seen.press, np.ones(len(seen)))
    return problem, problem.solve([TERM], START)


def rms(residual: np.ndarray) -> float:
    return float(np.sqrt((residual**2).mean()))


def test_channels_that_differ_are_the_form_s_error_and_are_predicted() -> None:
    problem, solved = fitted(SHARES)
    error = form_error(problem, solved, PARTITIONS, solved.effects)
    before, after = (rms(r) for r in (solved.scan_residual, solved.scan_residual - error.expected(problem, solved)))
    assert before > 1.5
    assert after**2 - 1 < 0.1 * (before**2 - 1)
    assert error.gain > 0.5 * solved.cost


def test_what_the_sheet_does_is_not_the_instrument_s_error() -> None:
    problem, solved = fitted(np.full(CHANNELS, 4e-3), SheetAnisotropy(stretch_diagonal=0.02))
    error = form_error(problem, solved, PARTITIONS, solved.effects)
    assert rms(solved.scan_residual) > 1.5
    assert error.gain < 0.2 * solved.cost


def test_cells_that_few_others_tell_of_gain_wildly_when_held_out() -> None:
    """A number known by one cell, and another that goes with it everywhere else, as form errors may."""
    rng = np.random.default_rng(0)
    known = 1e-2 * rng.standard_normal((4, 50))
    known[0] = 1.0
    beside = known + 1e-3 * rng.standard_normal(known.shape)
    beside[0] = 0.0
    wrong = rng.standard_normal(known.shape)
    wrong -= known * (known * wrong).sum() / (known**2).sum()
    columns = np.stack([known, beside], axis=-1)
    gradient, hessian = np.einsum("fnc,fn->fc", columns, wrong), np.einsum("fnc,fnd->fcd", columns, columns)
    predicted, fitted, _ = held_out_gains(gradient, hessian, np.array([0.0, 1.0]), np.zeros(1), [[k] for k in range(4)])
    assert predicted[0] > 1e3 * abs(fitted[0])


def test_no_cells_gain_more_held_out_than_they_change_by_when_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, solved = fitted(SHARES)
    count = len(solved.fit.value) + len(_other_forms(problem, solved.effects))
    gains = np.array([20000.0, 1.0, -0.5, 2.0]), np.array([3.0, 2.0, 4.0, -1.0]), np.zeros(count)
    monkeypatch.setattr("ertskin.diagnosis.search.form_error.held_out_gains", lambda *given: gains)
    assert form_error(problem, solved, PARTITIONS, solved.effects).gain == 3.0 + 1.0 - 0.5 + 1.0


def test_effects_of_the_skin_have_no_such_error() -> None:
    problem, solved = fitted(SHARES)
    error = form_error(problem, solved, PARTITIONS, ())
    assert error.gain == 0.0
    assert not error.expected(problem, solved).any()


def test_a_share_for_every_channel_leaves_no_form_error() -> None:
    problem, solved = fitted(SHARES)
    alike = Crosstalk(fraction=4e-3, shares=(0.0,) * CHANNELS)
    *_, each = alike.freer(("fraction",))
    found = problem.solve([Term(each.effect, each.free)], solved.calibration)
    np.testing.assert_allclose(found.terms[0].effect.shares, SHARES, atol=5e-5)  # type: ignore[attr-defined]
    assert rms(found.scan_residual) < 1.05
    forms = _other_forms(problem, found.effects)
    (size,) = {form.value("fraction") for form in forms}
    assert 2**-0.5 <= size / SHARES.mean() <= 2**0.5
    assert form_error(problem, found, PARTITIONS, found.effects).gain < 15
