"""What moves between rest frames: contacts, the whole sheet, or places that have not recovered from a press."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.rest.rest_frames import (
    _contact_drift,
    _largest_by_chance,
    _needed,
    _scatter,
    _shares,
    _undisturbed_mean,
    fitted_at_rest,
    wandering,
    wanders,
)
from ertskin.hardware.virtual.bench.nominal import nominal_sensor
from ertskin.physics.effects.contact_drift import ContactDrift
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy
from ertskin.physics.history import History
from ertskin.physics.piezo.polynomial import PiezoPolynomial
from ertskin.physics.protocol import Protocol
from ertskin.physics.skin import Skin

CONTACTS, NUMBERS, FRAMES = 8, 60, 30
PATH = np.linspace(-1.0, 1.0, FRAMES) ** 3
EACH = np.arange(FRAMES)
"""Runs of one rest frame each."""


def columns_and_traces(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """(P,L+1) derivatives, (R,P,3) orthonormal imprints that share much with the contacts' columns."""
    columns = rng.standard_normal((NUMBERS, CONTACTS + 1))
    near = columns[:, rng.integers(0, CONTACTS, (FRAMES, 3))].transpose(1, 0, 2)
    traces = np.linalg.qr(near + 0.7 * rng.standard_normal((FRAMES, NUMBERS, 3)))[0]
    traces[0] = 0.0
    return columns, traces


def who(change: np.ndarray, columns: np.ndarray, traces: np.ndarray, doubt: float = 0.0) -> list[int]:
    """The contacts found to wander in the changes, in units of the noise."""
    free = [trace @ trace.T for trace in traces]
    rest = np.stack([c - p @ c for c, p in zip(change, free, strict=True)])
    taken = traces.any(axis=1).sum(axis=1).tolist()
    return wandering(rest, [columns - p @ columns for p in free], taken, list(range(CONTACTS)), doubt)


def test_contacts_that_wander_are_distinguished_from_places_that_creep() -> None:
    rng = np.random.default_rng(0)
    columns, traces = columns_and_traces(rng)
    noise = rng.standard_normal((FRAMES, NUMBERS))
    walk = np.cumsum(rng.standard_normal((FRAMES, CONTACTS)), axis=0)
    assert who(noise + walk @ columns[:, :CONTACTS].T, columns, traces) == list(range(CONTACTS))
    # What something else's error may make is no contact's.
    changed = float(((walk @ columns[:, :CONTACTS].T) ** 2).sum())
    assert who(noise + walk @ columns[:, :CONTACTS].T, columns, traces, 2 * changed) == []
    creeping = noise + np.einsum("rpm,rm->rp", traces, 20 * rng.standard_normal((FRAMES, 3)))
    assert who(creeping, columns, traces) == []


def test_many_contacts_that_explain_most_but_not_all_did_not_wander() -> None:
    rng = np.random.default_rng(2)
    columns, traces = columns_and_traces(rng)
    along = columns[:, :CONTACTS] @ rng.standard_normal((CONTACTS, FRAMES))
    beyond = 0.2 * np.linalg.norm(along) / np.sqrt(along.size) * rng.standard_normal((NUMBERS, 1))
    something = along + beyond * rng.standard_normal(FRAMES)
    noise = rng.standard_normal((FRAMES, NUMBERS))
    assert who(noise + 2 * along.T, columns, traces) == list(range(CONTACTS))
    assert who(noise + 2 * something.T, columns, traces) == []
    few = columns[:, :2] @ rng.standard_normal((2, FRAMES))
    assert who(noise + 5 * (few + beyond * rng.standard_normal(FRAMES)).T, columns, traces) == [0, 1]


def test_one_loose_contact_is_found_beside_something_else() -> None:
    rng = np.random.default_rng(1)
    columns, traces = columns_and_traces(rng)
    change = rng.standard_normal((FRAMES, NUMBERS)) + 3 * rng.standard_normal((FRAMES, 1)) * rng.standard_normal(
        NUMBERS
    )
    change += np.outer(np.where(np.arange(FRAMES) % 5, 0.0, 8.0), columns[:, 3])
    assert who(change, columns, traces) == [3]


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
    columns, traces = columns_and_traces(rng)
    unit = columns[:, :CONTACTS] / np.linalg.norm(columns[:, :CONTACTS], axis=0)
    alike = rng.standard_normal((FRAMES, NUMBERS)) + 8 * rng.standard_normal((FRAMES, CONTACTS)) @ unit.T
    assert _scatter(alike, EACH, columns, (1.0, 0.0), DEFAULT).excess_noise.shape[1] == CONTACTS
    time_s = np.arange(float(FRAMES))
    change = alike - alike.mean(axis=0)
    contacts, run = np.full(CONTACTS, 300.0), np.arange(FRAMES)
    assert _contact_drift(change, time_s, run, 1.0, columns, np.zeros_like(traces), contacts, DEFAULT)[0] == ()


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


def drifting(largest: float) -> tuple[Effect, ...]:
    """What is said of a contact that changes from less to more by up to this part of itself, in noise a tenth of it."""
    rng = np.random.default_rng(7)
    columns, traces = columns_and_traces(rng)
    noise_v = largest / 10
    change = noise_v * rng.standard_normal((FRAMES, NUMBERS)) + largest * np.outer(PATH, columns[:, 5])
    frame, contacts = np.arange(FRAMES), np.full(CONTACTS, 300.0)
    return _contact_drift(change, 1.0 * frame, frame, noise_v, columns, np.zeros_like(traces), contacts, DEFAULT)[0]


def test_a_contact_that_drifts_is_followed() -> None:
    (drift,) = drifting(0.8)
    assert isinstance(drift, ContactDrift)
    np.testing.assert_allclose(np.array(drift.ohm) / 300.0, 0.8 * PATH, atol=0.064)


def test_a_path_that_leads_below_nothing_is_none_of_a_contact() -> None:
    assert drifting(1.5) == ()


def test_a_walk_is_distinguished_from_noise() -> None:
    rng = np.random.default_rng(8)
    none = np.zeros(40)
    assert not wanders(rng.standard_normal(40), none, DEFAULT)
    assert wanders(np.cumsum(rng.standard_normal(40)), none, DEFAULT)
    seen = np.sin(np.arange(200) / 20) + rng.standard_normal(200)
    assert wanders(seen, np.ones(200), DEFAULT)
    assert not wanders(seen, none, DEFAULT)
    for count, least in ((7, 0.25), (14, 0.75), (24, 0.9)):
        error = np.zeros(count)
        assert np.mean([wanders(rng.standard_normal(count), error, DEFAULT) for _ in range(500)]) < 0.04
        assert np.mean([wanders(np.cumsum(rng.standard_normal(count)), error, DEFAULT) for _ in range(500)]) > least


def test_a_contact_that_changes_from_press_to_press_does_not_drift() -> None:
    rng = np.random.default_rng(9)
    columns, traces = columns_and_traces(rng)
    run = np.repeat(np.arange(FRAMES // 3), 3)
    loose = np.where(rng.random(FRAMES // 3) < 0.4, 10.0, 0.0)[run]
    change = rng.standard_normal((FRAMES, NUMBERS)) + np.outer(loose - loose.mean(), columns[:, 2])
    given = (1.0, columns, np.zeros_like(traces), np.full(CONTACTS, 300.0), DEFAULT)
    assert _contact_drift(change, np.arange(float(FRAMES)), run, *given)[0] == ()


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
