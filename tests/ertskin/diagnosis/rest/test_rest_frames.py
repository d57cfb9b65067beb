"""What moves between rest frames: contacts, the whole sheet, or places that have not recovered from a press."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rest_changes import CONTACTS, FRAMES, NUMBERS, columns_and_traces, unsolved

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.rest.rest_frames import (
    _largest_by_chance,
    _needed,
    _scatter,
    _shares,
    _undisturbed_mean,
    fitted_at_rest,
)
from ertskin.diagnosis.rest.wandering_contacts import contact_drift
from ertskin.hardware.virtual.bench.nominal import nominal_sensor
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy
from ertskin.physics.history import History
from ertskin.physics.piezo.polynomial import PiezoPolynomial
from ertskin.physics.protocol import Protocol
from ertskin.physics.skin import Skin

PATH = np.linspace(-1.0, 1.0, FRAMES) ** 3
EACH = np.arange(FRAMES)
"""Runs of one rest frame each."""


def test_imprints_are_kept_only_where_they_are_needed() -> None:
    rng = np.random.default_rng(2)
    columns, traces = columns_and_traces(rng)
    noise = rng.standard_normal((FRAMES, NUMBERS))
    assert _needed(traces, noise, columns, 1.0).shape[2] == 0
    creeping = noise + np.einsum("rpm,rm->rp", traces, 5 * rng.standard_normal((FRAMES, 3)))
    assert _needed(traces, creeping, columns, 1.0).shape[2] == 3


def test_the_undisturbed_mean_knows_neither_creep_nor_drift() -> None:
    rng = np.random.default_rng(3)
    columns, traces = columns_and_traces(rng)
    truth = 100 * rng.standard_normal(NUMBERS)
    drift = np.linspace(-1, 1, FRAMES)[:, None] * columns[:, -1]
    scans = truth + drift + np.einsum("rpm,rm->rp", traces, 5 * rng.random((FRAMES, 3)))
    mean, found = scans.mean(axis=0), _undisturbed_mean(scans, columns, traces)
    outside = np.eye(NUMBERS) - columns @ np.linalg.pinv(columns)
    assert np.linalg.norm(outside @ (found - truth)) < 0.1 * np.linalg.norm(outside @ (mean - truth))
    own, place = _shares(scans - truth, columns, traces)
    np.testing.assert_allclose(own + place, scans - truth, atol=1e-9)


def test_the_mean_has_a_contact_where_the_frames_that_tell_it_have_it() -> None:
    """Places not recovered next to an electrode change the readings as its contact would, in the last frames alone."""
    rng = np.random.default_rng(12)
    columns = rng.standard_normal((NUMBERS, CONTACTS + 1))
    traces = np.zeros((FRAMES, NUMBERS, 1))
    traces[-3:, :, 0] = columns[:, 0] + 0.1 * rng.standard_normal((3, NUMBERS))
    traces[-3:] /= np.linalg.norm(traces[-3:], axis=1, keepdims=True)
    scans = 0.01 * rng.standard_normal((FRAMES, NUMBERS)) + 5.0 * traces[..., 0]
    share = np.linalg.lstsq(columns, _undisturbed_mean(scans, columns, traces), rcond=None)[0]
    assert np.abs(share).max() < 0.01
    frame, contacts = np.arange(FRAMES), np.full(CONTACTS, 300.0)
    given = 0.01, columns, traces, contacts, DEFAULT, unsolved
    assert contact_drift(scans - columns @ share, 1.0 * frame, frame, *given).effects == ()


def test_white_noise_has_no_excess_in_any_direction() -> None:
    rng = np.random.default_rng(4)
    columns, _ = columns_and_traces(rng)
    found = [
        _scatter(rng.standard_normal((FRAMES, NUMBERS)), EACH, columns, (1.0, 0.0), DEFAULT).excess_noise.shape[1]
        for _ in range(40)
    ]
    assert np.mean(np.array(found) > 0) <= 0.1
    jitter = rng.standard_normal((FRAMES, NUMBERS)) + np.outer(4 * rng.standard_normal(FRAMES), columns[:, 2])
    assert _scatter(jitter, EACH, columns, (1.0, 0.0), DEFAULT).excess_noise.shape[1] == 1
    assert _largest_by_chance(200, 9) < _largest_by_chance(20, 9)


def test_noise_of_rest_frames_is_known_no_better_than_that_of_the_readings_it_comes_from() -> None:
    rng = np.random.default_rng(4)
    columns, _ = columns_and_traces(rng)
    white = rng.standard_normal((FRAMES, NUMBERS))
    assert _scatter(white, EACH, columns, (1.0, 0.03), DEFAULT).error == 0.03
    assert _scatter(white[:2], EACH[:2], columns, (1.0, 0.03), DEFAULT).error == 0.03
    # Coloured noise is told by the rest frames themselves, by few of them worse still.
    assert _scatter(2 * white, EACH, columns, (1.0, 0.001), DEFAULT).error > 0.001


def test_a_contact_that_jitters_is_named_and_noise_is_not() -> None:
    rng = np.random.default_rng(5)
    columns, _ = columns_and_traces(rng)
    white = [
        _scatter(rng.standard_normal((FRAMES, NUMBERS)), EACH, columns, (1.0, 0.0), DEFAULT).jittering
        for _ in range(100)
    ]
    assert max(white) == -1
    unit = columns[:, 2] / np.linalg.norm(columns[:, 2])
    jitter = rng.standard_normal((FRAMES, NUMBERS)) + np.outer(8 * rng.standard_normal(FRAMES), unit)
    assert _scatter(jitter, EACH, columns, (1.0, 0.0), DEFAULT).jittering == 2
    # Coloured noise exceeds the noise along contacts too.
    assert _scatter(1.5 * jitter, EACH, columns, (1.0, 0.0), DEFAULT).jittering == -1


def test_a_contact_that_jitters_is_named_though_a_small_skin_scatters_more_by_chance() -> None:
    rng = np.random.default_rng(9)
    named, coloured = [], 0
    for _ in range(40):
        columns = rng.standard_normal((28, 9))
        unit = columns[:, 2] / np.linalg.norm(columns[:, 2])
        jitter = rng.standard_normal((13, 28)) + np.outer(20 * rng.standard_normal(13), unit)
        noise = _scatter(jitter, np.arange(13), columns, (1.0, 0.0), DEFAULT)
        named.append(noise.jittering)
        coloured += noise.rms_v > 1
    assert coloured > 5
    assert np.mean(np.array(named) == 2) > 0.9


def test_contacts_that_all_jitter_are_how_the_skin_is_made() -> None:
    rng = np.random.default_rng(6)
    columns, _ = columns_and_traces(rng)
    unit = columns[:, :CONTACTS] / np.linalg.norm(columns[:, :CONTACTS], axis=0)
    alike = rng.standard_normal((FRAMES, NUMBERS)) + 8 * rng.standard_normal((FRAMES, CONTACTS)) @ unit.T
    assert _scatter(alike, EACH, columns, (1.0, 0.0), DEFAULT).excess_noise.shape[1] == CONTACTS


def test_none_of_many_contacts_that_jitter_alike_is_the_loose_one() -> None:
    rng = np.random.default_rng(10)
    named = []
    for _ in range(60):
        columns = rng.standard_normal((NUMBERS, CONTACTS + 1)) * np.exp(0.5 * rng.standard_normal(CONTACTS + 1)) / 5
        alike = rng.standard_normal((FRAMES, CONTACTS)) @ columns[:, :CONTACTS].T
        named.append(
            _scatter(rng.standard_normal((FRAMES, NUMBERS)) + alike, EACH, columns, (1.0, 0.0), DEFAULT).jittering
        )
    assert np.mean(np.array(named) >= 0) <= 0.1


def test_a_contact_that_is_another_one_in_every_run_scatters_by_all_of_that() -> None:
    rng = np.random.default_rng(11)
    columns, _ = columns_and_traces(rng)
    unit = columns[:, 2] / np.linalg.norm(columns[:, 2])
    for rests in (1, 2, 5, 20):
        run = np.repeat(np.arange(36), rests)
        moved = 8 * rng.standard_normal(36)[run]
        noise = _scatter(
            rng.standard_normal((len(run), NUMBERS)) + np.outer(moved, unit), run, columns, (1.0, 0.0), DEFAULT
        )
        assert np.linalg.norm(noise.excess_noise) == pytest.approx(moved.std(), rel=0.25)
        assert noise.jittering == 2


def test_coloured_noise_is_known_as_well_as_it_says():
    rng = np.random.default_rng(2)
    columns = rng.standard_normal((NUMBERS, 5))
    width = np.exp(0.7 * rng.standard_normal(NUMBERS))
    found = [
        _scatter(width * rng.standard_normal((FRAMES, NUMBERS)), EACH, columns, (0.5, 0.0), DEFAULT) for _ in range(200)
    ]
    rms = np.array([noise.rms_v for noise in found])
    stated = np.mean([noise.error for noise in found])
    assert stated == pytest.approx(rms.std() / rms.mean(), rel=0.4)
    assert _scatter(rng.standard_normal((FRAMES, NUMBERS)), EACH, columns, (1.0, 0.0), DEFAULT).error == 0.0


def test_contacts_that_hardly_show_stay_with_the_others() -> None:
    """Neighbours drive, the others are read: a contact shows only by how it turns current aside under its pad. A sheet
    that conducts better along one direction then bends contacts by all that they can give."""
    sensor, law = nominal_sensor(), PiezoPolynomial(np.array([0.6, -0.4]), 6e4, 18e3)
    pair = np.arange(sensor.electrodes)[:, None] + [0, 1]
    pair %= sensor.electrodes
    current = np.zeros((len(pair), sensor.electrodes))
    np.put_along_axis(current, pair, [1e-3, -1e-3], axis=1)
    apart = ~(pair[:, None, :, None] == pair[None, :, None, :]).any(axis=(2, 3))
    protocol = replace(Protocol.differences(current, pair), measured=apart)
    true_ohm = np.random.default_rng(0).uniform(100.0, 500.0, sensor.electrodes)
    real = Skin.build(sensor, protocol, law, true_ohm, np.inf, (SheetAnisotropy(0.1, 0.05),), "fast")
    at_rest = History.of_presses(np.full((1, 2), 0.05), np.ones(1))
    scan_v = protocol.whitened(real.pair_resistance_ohm(at_rest)[0])
    begun = Skin.build(sensor, protocol, law, np.full(sensor.electrodes, 10.0), np.inf, (), "fast")
    skin, _, _ = fitted_at_rest(begun, scan_v)
    assert skin.contact_resistance_ohm.min() > 1.0
    assert skin.contact_resistance_ohm.max() < 1e5
