"""Contacts that settle together are found though none is seen to move from frame to frame."""

from __future__ import annotations

import numpy as np
import pytest
from rest_changes import unsolved

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.rest.settling_contacts import NONE_SETTLES, settling_contacts
from ertskin.diagnosis.rest.wandering_contacts import contact_drift, each_moved

CONTACTS, NUMBERS, FRAMES = 8, 28, 13
TIME_S = 40.0 * np.arange(FRAMES)
COURSE = np.log1p(TIME_S / 60.0) - np.log1p(TIME_S / 60.0).mean()


def columns_of(rng: np.random.Generator) -> np.ndarray:
    """(P,L+1) unit columns of contacts that overlap, and of the whole sheet."""
    columns = rng.standard_normal((NUMBERS, CONTACTS + 1)) + rng.standard_normal((NUMBERS, 1))
    return columns / np.linalg.norm(columns, axis=0)


def settled(seed: int, size: dict[int, float]) -> tuple[np.ndarray, np.ndarray]:
    """Changes (R,P) in units of the noise by contacts that settle beside a sheet that does as it likes, and columns."""
    rng = np.random.default_rng(seed)
    columns = columns_of(rng)
    own = sum((np.outer(share * COURSE, columns[:, k]) for k, share in size.items()), np.zeros((FRAMES, NUMBERS)))
    sheet = np.outer(20 * rng.standard_normal(FRAMES), columns[:, -1])
    return own + sheet + rng.standard_normal((FRAMES, NUMBERS)), columns


@pytest.mark.parametrize("seed", range(5))
def test_each_is_found_with_its_size(seed: int) -> None:
    size = {1: 6.0, 4: -5.0, 6: 5.0}
    change, columns = settled(seed, size)
    found = settling_contacts(change, [columns] * FRAMES, TIME_S)
    assert set(found.path) == set(size)
    for contact, path in found.path.items():
        np.testing.assert_allclose(path, size[contact] * COURSE, atol=2.5)


def test_noise_has_no_course() -> None:
    found = [settling_contacts(*settled_in_noise(seed), TIME_S).path for seed in range(200)]
    assert sum(map(bool, found)) <= 1


def settled_in_noise(seed: int) -> tuple[np.ndarray, list[np.ndarray]]:
    change, columns = settled(seed, {})
    return change, [columns] * FRAMES


def test_what_no_contact_does_is_shared_out_among_none() -> None:
    rng = np.random.default_rng(3)
    change, columns = settled(3, {1: 6.0})
    change = change + np.outer(20 * COURSE, rng.standard_normal(NUMBERS) / np.sqrt(NUMBERS))
    assert settling_contacts(change, [columns] * FRAMES, TIME_S) is NONE_SETTLES


def test_drifts_weaker_than_their_errors_are_found() -> None:
    change, columns = settled(9, {1: 4.5, 4: -4.5})
    traces = np.zeros((FRAMES, NUMBERS, 3))
    given = (np.arange(FRAMES), 1.0, 100 * columns, traces, np.full(CONTACTS, 300.0), DEFAULT, unsolved)
    moved, error = each_moved(change, 1.0, 100 * columns, traces)
    assert (np.sqrt(((moved / error) ** 2).mean(axis=0))[:CONTACTS] < DEFAULT.clear_errors).all()
    drifts, settling, usual_ohm = contact_drift(change, TIME_S, *given)
    assert [getattr(drift, "electrode", None) for drift in drifts] == [1, 4]
    assert settling == {1, 4}
    assert usual_ohm == pytest.approx(300.0)


@pytest.mark.parametrize(("size", "far"), [(0.05, False), (0.5, True)])
def test_what_settles_far_is_solved_in_full(size: float, far: bool) -> None:
    rng, traces, asked = np.random.default_rng(9), np.zeros((FRAMES, NUMBERS, 3)), []
    columns = columns_of(rng)
    change = size * (np.outer(COURSE, columns[:, 1]) + 0.02 * rng.standard_normal((FRAMES, NUMBERS)))

    def scan_of(ohm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        asked.append(ohm)
        return columns[:, :CONTACTS] @ (ohm / 300.0), columns[:, :CONTACTS] * (ohm / 300.0)

    given = (np.arange(FRAMES), 0.02 * size, columns, traces, np.full(CONTACTS, 300.0), DEFAULT, scan_of)
    drifts, settling, usual_ohm = contact_drift(change, TIME_S, *given)
    assert settling == {1}
    path = np.array(drifts[0].ohm)  # type: ignore[attr-defined]
    assert path.mean() == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(path, 300.0 * size * COURSE, atol=15.0)
    assert (np.diff(usual_ohm[1] + path) > 0).all()
    assert (usual_ohm[1] + path > 0).all()
    assert (usual_ohm[[0, 2, 3]] == 300.0).all()
    assert bool(asked) == far


def test_rest_frames_of_one_time_or_too_few_numbers_tell_nothing() -> None:
    change, columns = settled(0, {1: 6.0})
    assert settling_contacts(change, [columns] * FRAMES, np.full(FRAMES, 3.0)) is NONE_SETTLES
    few = slice(CONTACTS + 1)
    assert settling_contacts(change[:, few], [columns[few]] * FRAMES, TIME_S) is NONE_SETTLES
