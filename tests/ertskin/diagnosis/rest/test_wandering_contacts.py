"""Contacts that wander are told from places that creep, from jitter and from noise."""

from __future__ import annotations

import numpy as np
import pytest
from rest_changes import CONTACTS, FRAMES, NUMBERS, columns_and_traces, unsolved

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.rest.wandering_contacts import contact_drift, wandering, wanders
from ertskin.physics.effects.contact_drift import ContactDrift
from ertskin.physics.effects.effect import Effect

PATH = np.linspace(-1.0, 1.0, FRAMES) ** 3


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


def test_contacts_that_all_jitter_wander_nowhere() -> None:
    rng = np.random.default_rng(6)
    columns, traces = columns_and_traces(rng)
    unit = columns[:, :CONTACTS] / np.linalg.norm(columns[:, :CONTACTS], axis=0)
    alike = rng.standard_normal((FRAMES, NUMBERS)) + 8 * rng.standard_normal((FRAMES, CONTACTS)) @ unit.T
    time_s = np.arange(float(FRAMES))
    change = alike - alike.mean(axis=0)
    contacts, run = np.full(CONTACTS, 300.0), np.arange(FRAMES)
    assert contact_drift(change, time_s, run, 1.0, columns, np.zeros_like(traces), contacts, DEFAULT, unsolved)[0] == ()


def drifting(largest: float) -> tuple[Effect, ...]:
    """What is said of a contact that changes from less to more by up to this part of itself, in noise a tenth of it."""
    rng = np.random.default_rng(7)
    columns, traces = columns_and_traces(rng)
    noise_v = largest / 10
    change = noise_v * rng.standard_normal((FRAMES, NUMBERS)) + largest * np.outer(PATH, columns[:, 5])
    frame, contacts = np.arange(FRAMES), np.full(CONTACTS, 300.0)

    def scan_of(ohm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return columns[:, :CONTACTS] @ (ohm / contacts), columns[:, :CONTACTS] * (ohm / contacts)

    given = noise_v, columns, np.zeros_like(traces), contacts, DEFAULT, scan_of
    return contact_drift(change, 1.0 * frame, frame, *given).effects


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
    assert not wanders(seen, np.zeros(200), DEFAULT)
    for count, least in ((7, 0.25), (14, 0.75), (24, 0.9)):
        error = np.zeros(count)
        assert np.mean([wanders(rng.standard_normal(count), error, DEFAULT) for _ in range(500)]) < 0.04
        assert np.mean([wanders(np.cumsum(rng.standard_normal(count)), error, DEFAULT) for _ in range(500)]) > least


@pytest.mark.parametrize("uneven", [np.arange(40) >= 36, np.arange(40) % 2 == 1, np.arange(40) % 7 == 3], ids=str)
def test_frames_that_hardly_tell_a_contact_make_no_walk_and_hide_none(uneven: np.ndarray) -> None:
    rng, error = np.random.default_rng(13), np.where(uneven, 0.3, 0.01)

    def found(path: np.ndarray) -> bool:
        return wanders(path + error * rng.standard_normal(40), error, DEFAULT)

    # Of twenty frames white noise under errors half its size comes out so once in nineteen, however even the errors.
    assert np.mean([found(0.02 * rng.standard_normal(40)) for _ in range(500)]) < 0.07
    assert np.mean([found(np.linspace(-0.1, 0.1, 40)) for _ in range(200)]) > 0.9
    assert np.mean([found(0.05 * np.cumsum(rng.standard_normal(40))) for _ in range(200)]) > 0.9


def test_a_contact_that_changes_from_press_to_press_does_not_drift() -> None:
    rng = np.random.default_rng(9)
    columns, traces = columns_and_traces(rng)
    run = np.repeat(np.arange(FRAMES // 3), 3)
    loose = np.where(rng.random(FRAMES // 3) < 0.4, 10.0, 0.0)[run]
    change = rng.standard_normal((FRAMES, NUMBERS)) + np.outer(loose - loose.mean(), columns[:, 2])
    given = (1.0, columns, np.zeros_like(traces), np.full(CONTACTS, 300.0), DEFAULT, unsolved)
    assert contact_drift(change, np.arange(float(FRAMES)), run, *given)[0] == ()
