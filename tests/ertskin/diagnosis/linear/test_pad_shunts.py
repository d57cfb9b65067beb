"""What contacts do to scans, in series and past their pads, against sheets solved with other contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ertskin.diagnosis.linear.pad_shunts import by_series, conducting, pad_resistances
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import Sensor

ELECTRODES, RADIUS_M, SHEET_OHM_SQ = 8, 0.05, 1e3
DRIVEN = Protocol.against_sink(electrode_pairs(ELECTRODES), ELECTRODES, 1e-3)


def undriven() -> Protocol:
    """The same without readings of driven electrodes, neighbours read against each other."""
    reading = np.stack([np.arange(ELECTRODES), np.roll(np.arange(ELECTRODES), -1)], axis=1)
    apart = ~(electrode_pairs(ELECTRODES)[:, None, :, None] == reading[None, :, None, :]).any(axis=(2, 3))
    return replace(Protocol.differences(DRIVEN.injection_current_a, reading), measured=apart)


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
