"""Readings that an amplifier compresses softly: screened for, fitted, and not taken for a channel's gain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_skin import FOUR_PRESSES, SMALL, four_presses, small_law, small_sensor

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.linear.calibration_vector import SHAPE, Calibration, SkinFamily
from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.diagnosis.search.candidates import screen
from ertskin.diagnosis.search.trials import trials_of
from ertskin.physics.effects.adc_saturation import AdcSaturation
from ertskin.physics.effects.channel_gain import ChannelGain
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

CHANNELS, NOISE = 6, 1e-3
"""The noise over the largest reading."""
CONTACT_OHM = np.linspace(200.0, 900.0, CHANNELS)
START = Calibration(9000.0, CONTACT_OHM, 0.0, np.zeros(SHAPE))
PARTITIONS = [[k] for k in range(FOUR_PRESSES)]
FULL = Protocol.against_sink(electrode_pairs(CHANNELS), CHANNELS, 1e-4)
GAIN = ChannelGain(2, gain=0.01)


def undriven() -> Protocol:
    """Neighbours drive and neighbours are read, none of them at a driven electrode: every reading has a twin."""
    pairs = np.stack([np.arange(CHANNELS), np.roll(np.arange(CHANNELS), -1)], axis=1)
    current_a = np.eye(CHANNELS)[pairs[:, 0]] - np.eye(CHANNELS)[pairs[:, 1]]
    driven = np.array([[np.intp(k in pair or m in pair) for pair in pairs] for k, m in pairs], dtype=bool)
    scan = Protocol.differences(1e-3 * current_a, pairs)
    return Protocol(scan.injection_current_a, scan.measurement, measured=~driven)


def fitted(scan: Protocol, strength: float, gain: ChannelGain) -> tuple[VoltageProblem, Solved]:
    """The calibration alone fitted to readings bent by a hyperbolic tangent, the largest by strength**2 / 3."""
    skin = Skin.build(small_sensor(), scan, small_law(), CONTACT_OHM, 9000.0, (), SMALL)
    seen = four_presses()
    linear = LinearSkin(skin, seen, np.nan_to_num(skin.force_n(seen)), np.arange(len(seen)), None)
    basis = scan.orthonormal
    still = gain.distorted_v((linear.scans(skin) @ basis.T).reshape(-1, *scan.shape), scan)
    noise_v = NOISE * float(np.abs(still).max())
    scale_v = np.abs(still).max() / strength if strength else np.inf
    bent = scale_v * np.tanh(still / scale_v) if strength else still
    readings = bent + noise_v * scan.taken * np.random.default_rng(0).standard_normal(still.shape)
    flat = readings.reshape(len(seen), -1)
    scans = flat @ basis
    evidence = Evidence(
        skin.sensor, scan, seen, scans, (flat - scans @ basis.T).reshape(readings.shape).astype(np.float32), noise_v,
        noise_v, float("nan"), None, np.zeros((scans.shape[1], 0)), np.zeros((*scans.shape, 0)),
        1 - scans.shape[1] / scan.count, np.zeros(CHANNELS, dtype=np.intp),
    )  # fmt: skip
    problem = VoltageProblem(evidence, SkinFamily(skin, "fast"), linear, None, seen.press, np.ones(len(seen)))
    return problem, problem.solve((), START)


def rms(residual: np.ndarray) -> float:
    return float(np.sqrt((residual**2).mean()))


def test_a_compression_of_another_form_is_the_likeliest_name_and_is_fitted() -> None:
    problem, solved = fitted(FULL, 0.3, ChannelGain())
    first, *others = next(trials_of(problem, solved, screen(problem, solved, PARTITIONS), PARTITIONS, 0.0))
    assert rms(solved.scan_residual) > 1.2
    assert rms(first.solved.scan_residual) < 1.05
    assert all(first.gain > 2 * other.gain for other in others)
    (effect,) = first.solved.effects
    assert isinstance(effect, AdcSaturation)
    assert effect.compression == pytest.approx(0.3**2 / 3, rel=0.1)


def test_beside_a_channel_s_gain_both_are_found_in_the_order_in_which_they_act() -> None:
    problem, solved = fitted(FULL, 0.3, GAIN)
    for _ in range(2):
        found = screen(problem, problem.at_hand(solved), PARTITIONS)
        solved = next(trials_of(problem, solved, found, PARTITIONS, 0.0))[0].solved
    assert rms(solved.scan_residual) < 1.05
    bend, gain = solved.effects
    assert isinstance(bend, AdcSaturation)
    assert isinstance(gain, ChannelGain)
    assert bend.compression == pytest.approx(0.3**2 / 3, rel=0.1)
    assert (gain.channel, gain.gain) == (GAIN.channel, pytest.approx(GAIN.gain, rel=0.1))


def test_where_every_reading_has_a_twin_the_scans_alone_tell_of_it() -> None:
    problem, solved = fitted(undriven(), 0.1, ChannelGain())
    found = screen(problem, solved, PARTITIONS)
    assert found[0].name == AdcSaturation.name
    assert found[0].gain > problem.evidence.criteria.significant_gain
    assert found[0].beyond < 1.0


def test_straight_readings_show_no_compression() -> None:
    problem, solved = fitted(FULL, 0.0, ChannelGain())
    gains = [c.gain for c in screen(problem, solved, PARTITIONS) if c.name == AdcSaturation.name]
    assert max(gains, default=0.0) < problem.evidence.criteria.significant_gain


def test_scans_are_those_of_the_bent_readings_and_their_derivative_is_that_of_the_mean_one() -> None:
    problem, solved = fitted(FULL, 0.3, ChannelGain())
    bend, signal = AdcSaturation(compression=0.05, sharpness=3.0, level_v=0.1), problem.acquisition
    skin = problem.family.skin(solved.calibration, (GAIN, bend))
    still = signal.linear.scans(skin)
    readings = (still @ FULL.orthonormal.T).reshape(-1, *FULL.shape)
    whole = bend.distorted_v(GAIN.distorted_v(readings, FULL), FULL).reshape(len(still), -1) @ FULL.orthonormal
    np.testing.assert_allclose(signal.scans(skin), whole, atol=1e-12)
    matrix = signal.on_columns(replace(skin, effects=(bend,)))
    assert matrix is not None
    mean, change = still.mean(axis=0), 1e-4 * np.ones(still.shape[1])
    slope = signal.distorted(np.stack([mean + change, mean]), (bend,))
    np.testing.assert_allclose(matrix @ change, slope[0] - slope[1], rtol=0.02, atol=1e-7)
