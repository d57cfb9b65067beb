"""Contacts that grow many times over show what their pads shunt, which is far from linear in their resistance."""

from __future__ import annotations

import numpy as np
from small_skin import SMALL, small_law, small_sensor, two_presses, undriven

from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.diagnosis.linear.patches import followers
from ertskin.physics.effects.contact_drift import ContactDrift
from ertskin.physics.skin import Skin

CONTACTS = 6


def test_the_linearised_skin_follows_contacts_that_grow_thirtyfold_where_driven_electrodes_are_not_read() -> None:
    history, protocol = two_presses(), undriven()
    grown = ContactDrift(2, (0.0, 10.0, 40.0), (0.0, 3000.0, 9000.0))

    def skin(*effects: ContactDrift) -> Skin:
        return Skin.build(small_sensor(), protocol, small_law(), np.full(CONTACTS, 300.0), 9000.0, effects, SMALL)

    force_n = np.nan_to_num(skin().force_n(history))
    linear = LinearSkin(skin(grown), history, force_n, np.arange(len(history)), None)
    before, after = (protocol.whitened(one.pair_resistance_ohm(history, force_n)) for one in (skin(), skin(grown)))
    np.testing.assert_allclose(linear.scans(skin(grown), force_n), after, atol=0.03 * np.abs(after - before).max())


def test_frames_at_rest_share_a_solution_where_their_contacts_are_alike() -> None:
    contacts = np.array([[100.0, 50.0], [101.0, 50.0], [200.0, 50.0], [100.0, 49.0], [205.0, 51.0]])
    state_of, leaders = followers(np.zeros((5, 0)), contacts, contacts[0])
    assert leaders == [0, 2]
    assert state_of.tolist() == [0, 0, 1, 0, 1]
