"""What warmth explains of the changes between rest frames isn't left to contacts."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from small_skin import SMALL, small_law, small_sensor

from ertskin.diagnosis.rest.rest_frames import _warmth, fitted_at_rest
from ertskin.diagnosis.rest.warmth import warmth_at_rest
from ertskin.physics.effects.contact_drift import ContactDrift
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.self_heating import SelfHeating
from ertskin.physics.effects.temperature_drift import TemperatureDrift
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

NOISE_V = 2e-4
TIME_S = np.concatenate([100.0 * k + np.arange(20.0) for k in range(6)])
RESTS = np.isin(np.arange(len(TIME_S)) % 20, (0, 19))


@pytest.fixture(scope="module")
def skin() -> Skin:
    scan = Protocol.against_sink(electrode_pairs(6), 6, 1e-4)
    return Skin.build(small_sensor(), scan, small_law(), np.linspace(200.0, 900.0, 6), 9000.0, (), SMALL)


def at_rest(skin: Skin, *effects: Effect) -> tuple[Any, np.ndarray, np.ndarray]:
    """Evidence, changes of the rest frames (R,P) and what the whole sheet does (P,)."""
    nowhere = np.full((len(TIME_S), 1), np.nan)
    history = History(
        TIME_S,
        np.zeros(len(TIME_S), int),
        np.zeros(len(TIME_S), np.uint8),
        nowhere[:, None].repeat(2, 2),
        nowhere,
        nowhere,
    )
    pairs = replace(skin, effects=effects).pair_resistance_ohm(history, wanted=np.flatnonzero(RESTS))
    scans = skin.protocol.whitened(pairs)
    scans = scans + NOISE_V * np.random.default_rng(3).standard_normal(scans.shape)
    evidence = SimpleNamespace(sensor=skin.sensor, protocol=skin.protocol, history=history, noise_v=NOISE_V)
    return evidence, scans - scans.mean(axis=0), fitted_at_rest(skin, scans.mean(axis=0))[1][:, -1]


def test_it_takes_what_warmth_did_and_leaves_the_noise(skin: Skin) -> None:
    evidence, change, whole = at_rest(skin, SelfHeating(crowded_rise=-0.01, lasts_s=12.0))
    warmth, doubt, name, *_ = warmth_at_rest(skin, evidence, RESTS, change, whole)
    assert name == "self_heating"
    left = change - warmth
    assert np.sqrt((change**2).mean()) > 3 * NOISE_V
    assert np.sqrt((left**2).mean()) == pytest.approx(NOISE_V, rel=0.1)
    level = whole / np.linalg.norm(whole)
    uneven = warmth - np.outer(warmth @ level, level)
    assert doubt == pytest.approx(SelfHeating.form_error_at_rest**2 * (uneven**2).sum() / NOISE_V**2)
    assert doubt < 0.1 * SelfHeating.form_error_at_rest**2 * (warmth**2).sum() / NOISE_V**2


def test_a_room_warmer_on_one_side_is_no_contacts(skin: Skin) -> None:
    evidence, change, whole = at_rest(skin, TemperatureDrift(rate_per_h=-0.3, settle_h=0.1, gradient_x=0.6))
    warmth, _, name, *_ = warmth_at_rest(skin, evidence, RESTS, change, whole)
    assert name == "temperature_drift"
    assert np.sqrt((change**2).mean()) > 3 * NOISE_V
    assert np.sqrt(((change - warmth) ** 2).mean()) == pytest.approx(NOISE_V, rel=0.1)


@pytest.mark.parametrize("others", [(), (TemperatureDrift(rate_per_h=-1.0),)], ids=["noise", "an even drift"])
def test_it_takes_nothing_where_nothing_warms_unevenly(skin: Skin, others: tuple[Effect, ...]) -> None:
    evidence, change, whole = at_rest(skin, *others)
    warmth, doubt, name, *_ = warmth_at_rest(skin, evidence, RESTS, change, whole)
    assert not warmth.any()
    assert doubt == 0.0
    assert name is None


def test_what_is_uneven_within_chance_is_no_contacts_where_warmth_is_seen(skin: Skin) -> None:
    evidence, change, whole = at_rest(skin, SelfHeating(crowded_rise=-0.0006, lasts_s=12.0))
    level = whole / np.linalg.norm(whole)
    uneven = change - np.outer(change @ level, level)
    excess = (uneven**2).sum() / NOISE_V**2 - len(change) * (len(level) - 1)
    warmth, doubt, name, *_ = warmth_at_rest(skin, evidence, RESTS, change, whole)
    assert not warmth.any()
    assert doubt > excess
    assert name == "self_heating"


def settling(electrode: int, ohm: float) -> ContactDrift:
    course = np.log1p(TIME_S / 100.0)
    return ContactDrift(electrode, knot_s=tuple(TIME_S.tolist()), ohm=tuple((ohm * course).tolist()))


@pytest.mark.parametrize("warm", [True, False])
def test_it_is_seen_beside_contacts_that_settle(skin: Skin, warm: bool) -> None:
    heat = (SelfHeating(crowded_rise=-0.002, lasts_s=12.0),) if warm else ()
    evidence, change, _ = at_rest(skin, *heat, settling(1, 60.0), settling(4, -60.0))
    evidence.scan_v = np.zeros((len(TIME_S), change.shape[1]))
    evidence.scan_v[RESTS] = change
    columns = fitted_at_rest(
        skin, skin.protocol.whitened(skin.pair_resistance_ohm(evidence.history, wanted=np.zeros(1, int)))[0]
    )[1]
    found, beside = _warmth(skin, evidence, RESTS, columns, np.zeros((len(change), change.shape[1], 3)))
    assert found.name == ("self_heating" if warm else None)
    assert set(beside.size) == ({1, 4} if warm else set())
    assert found.change_v.any() == warm
