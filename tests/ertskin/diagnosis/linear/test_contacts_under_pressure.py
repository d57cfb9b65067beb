"""Contacts follow the pressure at every spot, and the linearised skin follows them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_skin import SMALL, small_law, small_sensor, two_presses, undriven

from ertskin.diagnosis.linear.calibration_vector import SHAPE, Calibration, SkinFamily
from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.physics.effects.contact_drift import ContactDrift
from ertskin.physics.effects.contact_pressure_dependence import ContactPressureDependence
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.electrode_displacement import ElectrodeDisplacement
from ertskin.physics.effects.temperature_drift import TemperatureDrift
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

SCAN = Protocol.against_sink(electrode_pairs(6), 6, 1e-4)
FOLLOWING = ContactPressureDependence(sensitivity_per_pa=3e-4, bend=0.5)
PERCOLATING = ContactPressureDependence(sensitivity_per_pa=1e-4, paths=10.0, order=2.5, percolates=True)


@pytest.fixture(scope="module")
def history() -> History:
    return two_presses()


def skin_with(*effects: Effect) -> Skin:
    return Skin.build(small_sensor(), SCAN, small_law(), np.linspace(200.0, 900.0, 6), 9000.0, effects, SMALL)


def beside(skin: Skin, electrode: int) -> np.ndarray:
    """(1,1,2) a place two pads' widths beside an electrode, towards the middle of the sheet."""
    center = skin.sheet.contacts[electrode].center_m.mean(axis=0)
    inwards = skin.sensor.extent_m.mean(axis=0) - center
    return (center + 5e-3 * inwards / np.linalg.norm(inwards))[None, None]


def test_contacts_at_rest_are_as_they_are() -> None:
    skin = skin_with(ContactDrift(2, (0.0, 40.0), (0.0, 20.0)), FOLLOWING)
    ohm, share = skin.contacts(np.array([0.0, 40.0]), np.full((2, 1, 2), np.nan), np.full((2, 1), np.nan))
    np.testing.assert_array_equal(ohm, skin.contact_resistance_ohm + np.outer([0.0, 20.0], np.eye(6)[2]))
    assert share is not None
    assert (share == 1).all()
    assert (
        skin_with(ContactDrift(2, (0.0,), (0.0,))).contacts(*(np.zeros(1), np.zeros((1, 1, 2)), np.ones((1, 1))))[1]
        is None
    )


def test_a_contact_conducts_more_where_it_is_pressed_more() -> None:
    skin = skin_with(FOLLOWING)
    place_m, force_n = beside(skin, 1), np.array([[5.0]])
    ohm, share = skin.contacts(np.zeros(1), place_m, force_n)
    assert share is not None
    contact, mine = skin.sheet.contacts[1], skin.sheet.cells[1]
    pressure = skin.pressure_pa(contact.center_m, place_m, force_n)[0]
    assert pressure.max() > 2 * pressure.min()
    alone = FOLLOWING.contact_resistance_ohm(
        np.full(pressure.shape, skin.contact_resistance_ohm[1]), pressure, np.zeros(1)
    )
    parallel = 1 / np.sum(contact.cell_size / contact.size / alone)
    assert ohm[0, 1] == pytest.approx(parallel)
    np.testing.assert_allclose(share[0, mine], parallel / alone)
    assert share[0, mine] @ contact.cell_size / contact.size == pytest.approx(1.0)


def test_a_contact_that_is_pressed_evenly_conducts_alike_all_over() -> None:
    skin = skin_with(replace(FOLLOWING, evenly=True))
    place_m, force_n = beside(skin, 1), np.array([[5.0]])
    ohm, share = skin.contacts(np.zeros(1), place_m, force_n)
    assert share is not None
    np.testing.assert_allclose(share, 1.0, rtol=1e-12)
    contact = skin.sheet.contacts[1]
    mean = skin.pressure_pa(contact.center_m, place_m, force_n) @ contact.cell_size / contact.size
    alone = FOLLOWING.contact_resistance_ohm(skin.contact_resistance_ohm[[1]], mean, np.zeros(1))
    np.testing.assert_allclose(ohm[0, 1], alone)


@pytest.mark.parametrize(
    ("contact", "changed"),
    [
        (FOLLOWING, {"sensitivity_per_pa": 4e-4}),
        (FOLLOWING, {"bend": 0.8}),
        (PERCOLATING, {"sensitivity_per_pa": 1.2e-4}),
        (PERCOLATING, {"paths": 12.0}),
        (PERCOLATING, {"order": 3.0}),
    ],
    ids=str,
)
def test_the_linearised_skin_follows_contacts_that_follow_their_pressure(
    history: History, contact: ContactPressureDependence, changed: dict[str, float]
) -> None:
    skin = skin_with(contact)
    contact_m = np.where(np.isfinite(history.contact_m), beside(skin, 1), np.nan)
    near = replace(history, contact_m=contact_m)
    force_n = np.nan_to_num(skin.force_n(near))
    linear = LinearSkin(skin, near, force_n, np.arange(len(near)), None)
    moved = replace(skin, effects=(contact.changed(changed),))
    before, after = (SCAN.whitened(one.pair_resistance_ohm(near, force_n)) for one in (skin, moved))
    np.testing.assert_allclose(linear.scans(skin, force_n), before, atol=0.02 * np.abs(after - before).max())
    change = linear.scans(moved, force_n) - linear.scans(skin, force_n)
    np.testing.assert_allclose(change, after - before, atol=0.1 * np.abs(after - before).max())


@pytest.mark.parametrize("contact_ohm", [500.0, 5e3, 5e4])
def test_it_follows_them_where_contacts_resist_more_than_the_sheet_and_driven_electrodes_are_not_read(
    history: History, contact_ohm: float
) -> None:
    """What a pad shunts goes as one over what its contact resists, and so does what it shows of where that conducts."""
    protocol, contacts = undriven(), np.full(6, contact_ohm)
    skin = Skin.build(small_sensor(), protocol, small_law(), contacts, 9000.0, (FOLLOWING,), SMALL)
    contact_m = np.where(np.isfinite(history.contact_m), beside(skin, 1), np.nan)
    near = replace(history, contact_m=contact_m)
    force_n = np.nan_to_num(skin.force_n(near))
    linear = LinearSkin(skin, near, force_n, np.arange(len(near)), None)
    other = replace(skin, contact_resistance_ohm=np.e * contacts)
    before, after = (protocol.whitened(one.pair_resistance_ohm(near, force_n)) for one in (skin, other))
    change = linear.scans(other, force_n) - linear.scans(skin, force_n)
    np.testing.assert_allclose(change, after - before, atol=0.05 * np.abs(after - before).max())


def test_contacts_of_another_mesh_are_read_on_the_linearised_skins(history: History) -> None:
    """A pad out of place needs a mesh of its own; what is tried beside it comes from the family's."""
    family = SkinFamily(skin_with(), SMALL)
    moved = ElectrodeDisplacement(electrode=1, dx_m=4e-4, dy_m=-3e-4)
    calibration = Calibration(small_law().zero_ohm_sq, np.linspace(200.0, 900.0, 6), 0.0, np.zeros(SHAPE))
    about = family.remeshed(calibration, (moved,))
    assert about.sheet is not family.skin(calibration, (moved,)).sheet
    force_n = np.nan_to_num(about.force_n(history))
    linear = LinearSkin(about, history, force_n, np.arange(len(history)), None)
    mild = FOLLOWING.changed({"sensitivity_per_pa": 5e-5})
    before, after = (
        SCAN.whitened(family.remeshed(calibration, effects).pair_resistance_ohm(history, force_n))
        for effects in ((moved,), (moved, mild))
    )
    asked = (family.skin(calibration, effects) for effects in ((moved, mild), (moved,)))
    change = np.subtract(*(linear.scans(each, force_n) for each in asked))
    np.testing.assert_allclose(change, after - before, atol=0.15 * np.abs(after - before).max())


@pytest.mark.parametrize("about", [(), (FOLLOWING,)], ids=["even", "uneven"])
def test_columns_by_contact_resistance_are_those_of_the_contacts_asked(
    history: History, about: tuple[Effect, ...]
) -> None:
    linear = LinearSkin(skin_with(*about), history, np.full((len(history), 1), 3.0), np.arange(len(history)), None)
    asked = skin_with(FOLLOWING.changed({"bend": 0.9}), TemperatureDrift(0.2))
    asked = replace(asked, piezo=small_law().scaled(1.4 * small_law().zero_ohm_sq))

    def scaled(electrode: int, by: float) -> Skin:
        return replace(asked, contact_resistance_ohm=asked.contact_resistance_ohm * np.exp(by * np.eye(6)[electrode]))

    columns = linear.contact_columns(
        asked, replace(asked, contact_resistance_ohm=np.exp(1e-3) * asked.contact_resistance_ohm)
    )
    for electrode in range(6):
        more, less = (linear.scans(scaled(electrode, by)) for by in (1e-3, -1e-3))
        expected = 0.5 * (more - less)
        np.testing.assert_allclose(columns[..., electrode], expected, atol=2e-3 * np.abs(expected).max() + 1e-9)
