"""Presses that land and press differently each time are told from places that differ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_skin import SMALL, small_law, small_sensor

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.judge.repeatability import repeatability
from ertskin.physics.history import History, Phase
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

NOISE_V = 2e-4
PLACES = np.array([[0.012, 0.012], [0.012, 0.03], [0.03, 0.012], [0.03, 0.03], [0.02, 0.021]])
VISITS = 3


@pytest.fixture(scope="module")
def skin() -> Skin:
    scan = Protocol.against_sink(electrode_pairs(6), 6, 1e-4)
    return Skin.build(small_sensor(), scan, small_law(), np.linspace(200.0, 900.0, 6), 9000.0, (), SMALL)


def presses(place_m: np.ndarray, force_n: np.ndarray) -> History:
    """A frame at rest and two loaded ones for each press at (N,2) with forces (N,)."""
    count = len(place_m)
    contact = np.repeat(place_m, 3, axis=0)[:, None]
    contact[::3] = np.nan
    force = np.repeat(force_n, 3)[:, None] * np.tile([np.nan, 1.0, 2.0], count)[:, None]
    phase = np.tile([Phase.REST, Phase.LOADING, Phase.HOLD], count).astype(np.uint8)
    depth = np.tile([np.nan, 1e-3, 2e-3], count)[:, None]
    return History(0.5 * np.arange(3 * count), np.repeat(np.arange(count), 3), phase, contact, depth, force)


def found(skin: Skin, landing_m: np.ndarray, strength: np.ndarray, force_n: float | np.ndarray = 3.0):  # type: ignore[no-untyped-def]
    """What is said of presses that landed ``landing_m`` (N,2) off and pressed ``strength`` (N,) times as hard."""
    place, force = np.tile(PLACES, (VISITS, 1)), np.broadcast_to(force_n, len(PLACES) * VISITS)
    nominal, real = presses(place, force), presses(place + landing_m, force * strength)
    rows = np.flatnonzero(nominal.touched.any(axis=1))

    def scans(other: Skin, force_n: np.ndarray) -> np.ndarray:
        readings = other.readings_v(nominal, force_n, rows)
        return readings.reshape(len(rows), -1) @ skin.protocol.orthonormal / NOISE_V

    seen = skin.readings_v(real, np.nan_to_num(real.force_n), rows)
    seen = seen + NOISE_V * np.random.default_rng(0).standard_normal(seen.shape)
    force_n = np.nan_to_num(nominal.force_n)
    residual = seen.reshape(len(rows), -1) @ skin.protocol.orthonormal / NOISE_V - scans(skin, force_n)
    return repeatability(
        residual, scans, skin, force_n, nominal.press[rows], nominal.contact_m[rows, 0], force_n[rows].sum(axis=1)
    )


def test_presses_that_scatter_are_found_with_how_much(skin: Skin) -> None:
    rng = np.random.default_rng(1)
    landing, strength = 3e-4 * rng.standard_normal((15, 2)), 1 + 0.08 * rng.standard_normal(15)
    scatter = found(skin, landing, strength)
    assert scatter.matters(DEFAULT)
    assert scatter.landing_m == pytest.approx(np.sqrt((landing**2).mean()), rel=0.2)
    assert scatter.strength == pytest.approx(np.sqrt(((strength - 1) ** 2).mean()), rel=0.25)
    assert scatter.without > 3
    assert scatter.ratio**2 - 1 < 0.2 * (scatter.without**2 - 1)


def test_places_that_differ_are_not_presses_that_differ(skin: Skin) -> None:
    rng = np.random.default_rng(2)
    strength = np.tile(1 + 0.1 * rng.standard_normal(len(PLACES)), VISITS)
    scatter = found(skin, np.zeros((15, 2)), strength)
    assert scatter.between_repeats < 0.3
    assert not scatter.matters(DEFAULT)


def test_what_goes_with_the_load_or_with_the_first_press_is_no_scatter(skin: Skin) -> None:
    stay = np.zeros((15, 2))
    first = np.where(np.arange(15) < len(PLACES), 1.08, 0.96)
    load_n = np.repeat([2.0, 4.0, 3.0], len(PLACES))
    for strength in (first, 0.8 + load_n / 15):
        scatter = found(skin, stay, strength, load_n)
        assert scatter.without > 1.2
        assert not scatter.matters(DEFAULT)


def test_a_press_that_missed_the_skin_takes_no_part(skin: Skin) -> None:
    rng = np.random.default_rng(1)
    strength = 1 + 0.08 * rng.standard_normal(15)
    load_n = np.where(np.arange(15) == 7, 0.0, 3.0)
    assert found(skin, 3e-4 * rng.standard_normal((15, 2)), strength, load_n).matters(DEFAULT)


def test_presses_that_repeat_leave_nothing_to_say(skin: Skin) -> None:
    scatter = found(skin, np.zeros((15, 2)), np.ones(15))
    assert scatter.without == pytest.approx(1.0, abs=0.1)
    assert not replace(scatter, between_repeats=float("nan")).matters(DEFAULT)
