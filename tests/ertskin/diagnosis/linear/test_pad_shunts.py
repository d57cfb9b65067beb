"""What contacts do to scans, in series and past their pads, against sheets solved with other contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_skin import small_sensor

from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.diagnosis.linear.pad_shunts import by_series, conducting, pad_resistances, uneven
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.history import History, Phase
from ertskin.physics.piezo.polynomial import PiezoPolynomial
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import Sensor
from ertskin.physics.skin import Skin

ELECTRODES, RADIUS_M, SHEET_OHM_SQ = 8, 0.05, 1e3
DRIVEN = Protocol.against_sink(electrode_pairs(ELECTRODES), ELECTRODES, 1e-3)


def undriven() -> Protocol:
    """The same without readings of driven electrodes, neighbours read against each other."""
    reading = np.stack([np.arange(ELECTRODES), np.roll(np.arange(ELECTRODES), -1)], axis=1)
    apart = ~(electrode_pairs(ELECTRODES)[:, None, :, None] == reading[None, :, None, :]).any(axis=(2, 3))
    return replace(Protocol.differences(DRIVEN.injection_current_a, reading), measured=apart)


def at_rest() -> History:
    nowhere = np.full((1, 1), np.nan)
    rest = np.array([Phase.REST], dtype=np.uint8)
    return History(np.zeros(1), np.zeros(1, dtype=int), rest, np.full((1, 1, 2), np.nan), nowhere, nowhere)


def layered(bare: Sensor) -> Sensor:
    """The sensor under small_skin's pad."""
    pad = small_sensor()
    return replace(bare, layers=pad.layers, piezo_interface=1, pad_margin_m=0.03)


def sensor(edge: bool) -> Sensor:
    angle = 2 * np.pi * np.arange(128) / 128
    outline = RADIUS_M * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    first = 16 * np.arange(ELECTRODES)
    if edge:
        return Sensor(outline, 1e3, 20.0, electrode_edge_m=np.stack([outline[first], outline[first + 3]], axis=1))
    return Sensor(outline, 1e3, 20.0, 0.5 * outline[first], np.full((ELECTRODES, 2), 5e-3))


@pytest.mark.parametrize("edge", [False, True])
@pytest.mark.parametrize("protocol", [DRIVEN, undriven()], ids=["driven", "undriven"])
@pytest.mark.parametrize("contact_ohm", [50.0, 300.0, 3000.0])
@pytest.mark.parametrize("logarithm", [-1.5, 1.0, 3.0])
def test_scans_follow_a_contact_that_resists_otherwise(
    edge: bool, protocol: Protocol, contact_ohm: float, logarithm: float
) -> None:
    model, before_ohm = SheetModel(sensor(edge), "fast"), np.full(ELECTRODES, contact_ohm)
    after_ohm = before_ohm * np.where(np.arange(ELECTRODES) == 2, np.exp(logarithm), 1.0)
    before, after = (model.solve(model.uniform(SHEET_OHM_SQ), each) for each in (before_ohm, after_ohm))
    change = protocol.whitened(after.pair_resistance_ohm) - protocol.whitened(before.pair_resistance_ohm)

    by_ohm = protocol.whitened(before.jacobian_contact_resistance().T).T
    series, pad_ohm = by_series(protocol), pad_resistances(model, SHEET_OHM_SQ)
    was, now = (conducting(each, pad_ohm) for each in (before_ohm, after_ohm))
    shunts = (series - by_ohm) / was**2
    found = series @ (after_ohm - before_ohm) + shunts @ (now - was)
    straight = by_ohm @ (after_ohm - before_ohm)
    off, straight_off = (np.abs(each - change).max() / np.abs(change).max() for each in (found, straight))
    assert off < 0.14
    assert off < 0.7 * straight_off


def test_what_lies_in_series_is_not_read_where_driven_electrodes_are_not() -> None:
    assert np.abs(by_series(undriven())).max() < 1e-9 * np.abs(by_series(DRIVEN)).max()


@pytest.mark.parametrize("edge", [False, True])
@pytest.mark.parametrize("protocol", [DRIVEN, undriven()], ids=["driven", "undriven"])
def test_the_linearised_skin_follows_contacts_far_from_those_it_is_linearised_about(
    edge: bool, protocol: Protocol
) -> None:
    law = PiezoPolynomial.fit(np.linspace(0, 6e4, 40), SHEET_OHM_SQ * (1 - 5e-6 * np.linspace(0, 6e4, 40)))
    history = at_rest()
    skin = Skin.build(layered(sensor(edge)), protocol, law, np.full(ELECTRODES, 300.0), 9000.0, (), "fast")
    linear = LinearSkin(skin, history, np.zeros((len(history), 1)))
    other = replace(skin, contact_resistance_ohm=300.0 * np.exp(np.linspace(-1.0, 2.0, ELECTRODES)))
    one, two = (protocol.whitened(each.pair_resistance_ohm(history, np.zeros((1, 1)))) for each in (skin, other))
    np.testing.assert_allclose(linear.scans(other), two, atol=0.1 * np.abs(two - one).max())


def test_an_uneven_contact_shows_by_the_less_of_its_resistance_and_its_pads() -> None:
    assert uneven(np.array([1e-3, 100.0, 1e6]), np.full(3, 100.0)) == pytest.approx([1e-3, 50.0, 100.0], rel=1e-3)
