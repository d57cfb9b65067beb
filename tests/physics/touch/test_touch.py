"""Contacts anywhere: splines, what contacts do together, and the posterior over them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.stats import chi2
from toy_skin import EXTENT_M, response, toy_table

from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.sensor import Sensor
from ertskin.physics.touch import search
from ertskin.physics.touch.interplay import Interplay, pair_change
from ertskin.physics.touch.posterior import descended, roughly
from ertskin.physics.touch.search import Search, TouchPosterior
from ertskin.physics.touch.spline import basis, coefficients


def test_splines_and_their_slopes_are_scipys():
    nodes = np.array([0.0, 0.3, 1.0, 1.7, 2.5, 3.1, 4.0])
    knots, found = coefficients(nodes, np.sin(nodes), 0)
    spline, value = BSpline(knots, found, 3), np.empty((3, 4))
    for at in (0.0, 0.1, 1.2, 3.99, 4.0):
        first = basis(knots, at, value)
        for order in range(3):
            assert value[order] @ found[first : first + 4] == pytest.approx(float(spline(at, order)), abs=1e-12)


def test_a_table_gives_the_response_and_its_slopes_between_its_places():
    table, rng = toy_table(), np.random.default_rng(0)
    place, force = rng.uniform(EXTENT_M[0], EXTENT_M[1], (50, 2)), rng.uniform(0.5, 5.5, 50)
    rows = table.tangents(place, force)
    exact = response(place, force)
    assert np.abs(rows[:, 0] - exact).max() < 2e-3 * exact.max()
    step = np.array([1e-5, 0.0])
    slope = (response(place + step, force) - response(place - step, force)) / 2e-5
    assert np.abs(rows[:, 1] - slope).max() < 2e-2 * np.abs(slope).max()


@pytest.fixture(scope="module")
def sheet():
    grid = [(x, y) for x in (0.008, 0.04, 0.072) for y in (0.008, 0.04, 0.072) if (x, y) != (0.04, 0.04)]
    sensor = Sensor(
        outline_m=np.array([[0.0, 0.0], [0.08, 0.0], [0.08, 0.08], [0.0, 0.08]]),
        electrode_center_m=np.array(grid),
        electrode_size_m=np.full((8, 2), 4e-3),
    )
    return SheetModel(sensor, "fast")


@pytest.mark.parametrize("apart_m", [0.018, 0.03])
def test_cells_tell_what_two_pressed_places_do_together(sheet, apart_m):
    rest = sheet.solve(sheet.uniform(18e3), np.full(8, 300.0))

    def pressed(places):
        conductivity = sheet.uniform(18e3)
        for place in places:
            away2 = ((sheet.quadrature_m - place) ** 2).sum(axis=2)
            conductivity += 1.0 / 18e3 * np.exp(-0.5 * away2 / 5e-3**2)
        return sheet.solve(conductivity, np.full(8, 300.0)).pair_resistance_ohm - rest.pair_resistance_ohm

    places = np.array([[0.03, 0.035], [0.03 + apart_m, 0.045]])
    added = pressed(places) - pressed(places[:1]) - pressed(places[1:])
    inter = Interplay.of(rest, 4e-3)
    cells, change = [], []
    for place in places:
        away2 = ((inter.center_m - place) ** 2).sum(axis=1)
        near = np.flatnonzero(away2 < 0.016**2)
        cells.append(near)
        change.append(1.0 / 18e3 * np.exp(-0.5 * away2[near] / 5e-3**2))
    error = inter.change_ohm(cells, change) - added
    assert np.linalg.norm(error) < 0.25 * np.linalg.norm(added)


def test_what_contacts_add_together_is_that_of_all_equations_less_each_contacts_own(sheet):
    inter = Interplay.of(sheet.solve(sheet.uniform(18e3), np.full(8, 300.0)), 4e-3)
    cells = [np.array([60, 61, 62]), np.array([90, 91, 92, 93, 94]), np.array([60, 120])]
    change = [np.array([3e-5, 1e-4, -2e-6]), np.full(5, 5e-5), np.array([2e-5, 4e-5])]

    def answered(some):
        at, change_s = np.concatenate([cells[c] for c in some]), np.concatenate([change[c] for c in some])
        strength = np.repeat(inter.area_m2[at] * change_s, 2)
        green = inter.green[at][:, :, at].reshape(len(strength), -1)
        field = inter.field[at].reshape(len(strength), -1)
        return (field.T * strength) @ np.linalg.solve(np.eye(len(strength)) + green * strength, field)

    direct = sum(answered([c]) for c in range(3)) - answered([0, 1, 2])
    np.testing.assert_allclose(inter.change_ohm(cells, change), pair_change(direct), atol=1e-9 * np.abs(direct).max())


@pytest.fixture(scope="module")
def posterior():
    return TouchPosterior(toy_table(), np.full(4, 1e-3), 0.0, np.zeros(3), 0.1)


def drawn(rng, count):
    while True:
        place = rng.uniform(EXTENT_M[0] + 4e-3, EXTENT_M[1] - 4e-3, (count, 2))
        away = np.linalg.norm(place[:, None] - place, axis=2)[np.triu_indices(count, 1)]
        if not len(away) or away.min() > 0.02:
            return place, rng.uniform(0.5, 5.0, count)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_contacts_are_found_counted_and_as_sure_as_stated(posterior, count):
    rng = np.random.default_rng(count)
    right, inside, shown = 0, 0, 40
    for _ in range(shown):
        place, force = drawn(rng, count)
        reading = response(place, force).sum(axis=0) + rng.standard_normal(42)
        found = posterior.of(reading[None])
        said = np.isfinite(found.force_n[0]).sum()
        right += said == count
        first = np.linalg.norm(found.contact_m[0] - place[0], axis=1)
        slot = int(np.nanargmin(first))
        error = np.r_[found.contact_m[0, slot] - place[0], found.force_n[0, slot] - force[0]]
        inside += error @ np.linalg.solve(found.covariance[0, slot], error) <= chi2.ppf(0.9, 3)
    assert right >= 0.95 * shown
    assert 0.75 * shown <= inside


def test_a_contact_that_is_not_proposed_is_found(posterior):
    rng = np.random.default_rng(11)
    for _ in range(20):
        place, force = drawn(rng, 3)
        reading = response(place, force).sum(axis=0) + rng.standard_normal(42)
        proposed = np.column_stack([place + rng.normal(0.0, 2e-3, place.shape), force])
        found = posterior.of(reading[None], proposed[None, :2])
        np.testing.assert_allclose(np.sort(found.force_n[0, :3]), np.sort(force), atol=0.3)
        assert np.isnan(found.force_n[0, 3])


@pytest.mark.parametrize("apart_m", [0.014, 0.02])
def test_two_contacts_taken_for_one_in_between_are_parted(posterior, apart_m):
    """By the search for one more, at once: what both leave of the one is no contact anywhere."""
    rng = np.random.default_rng(12)
    for _ in range(20):
        angle, other = rng.uniform(0.0, np.pi), np.array([0.015, 0.015])
        middle = rng.uniform([0.045, 0.025], [0.06, 0.04])
        side = 0.5 * apart_m * np.array([np.cos(angle), np.sin(angle)])
        place, force = np.stack([other, middle + side, middle - side]), rng.uniform(1.0, 2.0, 3)
        reading = response(place, force).sum(axis=0) + rng.standard_normal(42)
        near = roughly(reading, np.array([[*other, force[0]], [*middle, force[1:].sum()]]), posterior._model)
        start = posterior._scan.with_one_more(near.left, near.touch, 1)[0]
        assert np.linalg.norm(start[:, None, :2] - place[1:], axis=2).min(axis=0).max() < 6e-3


def test_nothing_is_found_in_noise_and_a_strange_reading_shows(posterior):
    rng = np.random.default_rng(9)
    quiet = posterior.of(rng.standard_normal((50, 42)))
    assert np.isfinite(quiet.force_n).any(axis=1).mean() <= 0.04
    assert quiet.misfit.mean() == pytest.approx(1.0, abs=0.1)
    strange = posterior.of(200.0 * rng.standard_normal((1, 42)))
    assert strange.misfit[0] > 100


def test_a_reading_that_is_no_number_has_no_contacts(posterior):
    found = posterior.of(np.full((1, 42), np.nan), np.array([[[0.03, 0.02, 2.0]]]))
    assert not np.isfinite(found.force_n).any()
    assert np.isnan(found.misfit[0])


def test_types_of_arrays_compile_nothing_anew(posterior):
    inter = posterior.table.interplay
    single = Interplay(*(getattr(inter, name).astype(np.float32) for name in ("center_m", "area_m2", "field", "green")))
    table = replace(posterior.table, knots_x=posterior.table.knots_x.astype(np.float32), interplay=single)
    other = replace(posterior, table=table, spread=posterior.spread.astype(np.float32), error=np.zeros(3, np.float32))
    reading = response(np.array([[0.03, 0.02], [0.06, 0.05]]), np.array([2.0, 3.0])).sum(axis=0, keepdims=True)
    posterior.of(reading)
    kinds = len(descended.signatures)
    assert np.isfinite(other.of(reading).force_n).sum() == 2
    assert len(descended.signatures) == kinds


def test_a_table_in_fewer_coordinates_reads_the_same(posterior):
    matrix = np.linalg.qr(np.random.default_rng(0).normal(size=(42, 42)))[0]
    turned = replace(posterior, table=posterior.table.seen(matrix))
    place, force = np.array([[0.03, 0.02]]), np.array([2.0])
    reading = response(place, force)
    one, other = posterior.of(reading), turned.of(reading @ matrix)
    assert np.allclose(one.contact_m, other.contact_m, atol=1e-6, equal_nan=True)


def searches(monkeypatch):
    """How many contacts were proposed in each search."""
    begun, run = [], Search.run
    monkeypatch.setattr(Search, "run", lambda self, fit=None: (run(self, fit), begun.append(self.asked)))
    return begun


def test_contacts_that_stay_are_not_searched_for_again(posterior, monkeypatch):
    begun, rng, nothing = searches(monkeypatch), np.random.default_rng(3), lambda: np.empty((0, 3))
    place, force = np.array([[0.03, 0.02], [0.06, 0.04]]), np.array([2.0, 3.0])
    # What no contacts explain: as good as it gets is poor, scan after scan.
    strange = 4.0 * rng.standard_normal(42)
    held = None
    for step in range(10):
        reading = response(place, (1.0 + 0.02 * step) * force).sum(axis=0) + strange + rng.standard_normal(42)
        found, held = posterior.followed(reading, nothing, held)
        assert found.misfit[0] > 2.0
    assert len(begun) == 1


def test_the_network_is_asked_only_where_contacts_held_explain_too_little(posterior):
    rng, asked = np.random.default_rng(5), []
    place, force = np.array([[0.03, 0.02], [0.06, 0.04]]), np.array([2.0, 3.0])

    def propose():
        asked.append(len(asked))
        return np.column_stack([place, force])

    held = None
    for step in range(10):
        reading = response(place, (1.0 + 0.02 * step) * force).sum(axis=0) + 0.5 * rng.standard_normal(42)
        _, held = posterior.followed(reading, propose, held)
    assert len(asked) == 1
    third = response(np.array([[0.03, 0.05]]), np.array([1.0]))[0]
    found, _ = posterior.followed(reading + third, propose, held)
    assert len(asked) == 2
    assert np.isfinite(found.force_n).sum() == 3


def test_contacts_that_have_come_to_fit_poorly_are_looked_beside_from_where_they_are(posterior, monkeypatch):
    begun, rng = searches(monkeypatch), np.random.default_rng(6)
    place, force = np.array([[0.03, 0.02], [0.06, 0.04]]), np.array([2.0, 3.0])
    clean, noise = response(place, force).sum(axis=0), rng.standard_normal(42)
    held = None
    for size in (1.1, 1.6, 1.6):
        reading = clean + size * noise * np.sqrt(42) / np.linalg.norm(noise)
        found, held = posterior.followed(reading, lambda: np.column_stack([place, force])[:1], held)
        assert np.isfinite(found.force_n).sum() == 2
    # The second search begins from the contacts held, and one more is out of question: none were asked for.
    assert begun == [1, 0]


def test_contacts_followed_are_those_of_a_search_afresh(posterior):
    """One finger, a second beside it, the first lifted, another place at once, a light touch more, all let go."""
    one, two, third = [0.02, 0.02, 2.0], [0.06, 0.04, 3.0], [0.035, 0.05, 0.4]
    touches = [[one], [one], [one, two], [one, two], [two], [third, one], [third, one, two], [one, two], []]
    rng, held, nothing = np.random.default_rng(4), None, lambda: np.empty((0, 3))
    for touch in touches:
        contacts = np.array(touch).reshape(-1, 3)
        for _ in range(5):
            reading = response(contacts[:, :2], contacts[:, 2]).sum(axis=0) + rng.standard_normal(42)
            afresh, (found, held) = posterior.of(reading[None]), posterior.followed(reading, nothing, held)
            known, other = np.isfinite(found.force_n[0]), np.isfinite(afresh.force_n[0])
            assert known.sum() == other.sum() == len(touch)
            assert (held is None) == (not touch)
            for place, force, covariance in zip(
                found.contact_m[0, known], found.force_n[0, known], found.covariance[0, known], strict=True
            ):
                near = np.linalg.norm(afresh.contact_m[0, other] - place, axis=1).argmin()
                error = np.r_[place - afresh.contact_m[0, near], force - afresh.force_n[0, near]]
                assert np.all(np.abs(error) < 0.1 * np.sqrt(np.diagonal(covariance)))
            np.testing.assert_allclose(found.count_probability, afresh.count_probability, atol=0.05)


@pytest.mark.parametrize("light_n", [0.08, 0.1])
def test_a_light_touch_beside_one_that_stays_is_found_as_often_as_afresh(light_n):
    posterior = TouchPosterior(toy_table(), np.zeros(3), 0.0, np.zeros(3), 0.05)
    counts = []

    def nothing():
        return np.empty((0, 3))

    for seed in range(40):
        rng = np.random.default_rng(seed)
        one = response(np.array([[0.02, 0.02]]), np.array([3.0]))[0]
        _, held = posterior.followed(one + rng.standard_normal(42), nothing)
        reading = one + response(np.array([[0.055, 0.045]]), np.array([light_n]))[0] + rng.standard_normal(42)
        found, _ = posterior.followed(reading, nothing, held)
        counts.append([np.isfinite(each.force_n).sum() for each in (found, posterior.of(reading[None]))])
    followed, afresh = np.array(counts).T
    assert np.mean(followed == afresh) >= 0.95
    assert np.mean(afresh == 2) > 0.9


def test_contacts_that_explain_little_are_searched_for_again_once_others_are_proposed(posterior, monkeypatch):
    begun, rng = searches(monkeypatch), np.random.default_rng(3)
    three = np.array([[0.03, 0.02, 2.0], [0.06, 0.04, 3.0], [0.03, 0.05, 0.3]])
    two = three[:2]
    reading = response(two[:, :2], two[:, 2]).sum(axis=0) + 4.0 * rng.standard_normal(42)
    held = None
    for proposed in (two, two, three, three, two, three):
        _, held = posterior.followed(reading + 0.3 * rng.standard_normal(42), lambda proposed=proposed: proposed, held)
    assert begun == [2, 3]


def test_a_response_is_the_same_on_more_forces() -> None:
    table = toy_table()
    place, force = np.array([[0.03, 0.04], [0.05, 0.02]]), np.array([0.7, 3.3])
    finer = table.with_forces(2)
    assert len(finer.grid.force_n) == 2 * len(table.grid.force_n)
    np.testing.assert_allclose(finer.alone(place, force), table.alone(place, force), rtol=0.02)
    at_nodes = np.full(2, table.grid.force_n[1])
    np.testing.assert_allclose(finer.alone(place, at_nodes), table.alone(place, at_nodes), rtol=1e-5)


def test_a_contact_added_at_once_that_explains_too_little_is_weighed_against_those_proposed(monkeypatch) -> None:
    """What is wrong may be something else: a reading that no contacts explain has as many as without the short way."""
    posterior = TouchPosterior(toy_table(), np.zeros(3), 0.0, np.zeros(3), 0.1)
    for seed in range(8, 16):
        rng = np.random.default_rng(seed)
        place, force = rng.uniform(EXTENT_M[0] + 0.01, EXTENT_M[1] - 0.01, (1, 2)), rng.uniform(0.3, 4.0, 1)
        clean = response(place, force)
        foreign = rng.standard_normal(clean.shape)
        foreign *= 1.6 * np.sqrt(foreign.size) / np.linalg.norm(foreign)
        reading = clean + foreign + 0.3 * rng.standard_normal(clean.shape)
        proposed = np.append(place + rng.normal(0.0, 2e-3, 2), 1.2 * force)[None, None]
        found = []
        for lacking in (0.0, np.inf):
            monkeypatch.setattr(search, "LACKING", lacking)
            found.append(posterior.of(reading, proposed))
        np.testing.assert_array_equal(np.isfinite(found[0].force_n), np.isfinite(found[1].force_n))


def test_a_ghost_that_a_wrong_valley_left_is_weighed_again(posterior):
    """One contact came out badly when weighed alone, and again with another in a corner that takes what it left."""
    reading = response(np.array([[0.03, 0.04]]), np.array([2.0]))[0] + np.random.default_rng(3).normal(size=42)

    def with_ghost(square):
        found = posterior._search(reading, lambda: np.empty((0, 3)))
        found.logs[1] = found.logs[0] + 1.0
        both = np.array([[0.03, 0.04, 2.0], [0.078, 0.002, 0.12]])
        found._keep(search.fitted(reading, both, posterior._model, steps=0))
        found.logs[2] = found.logs[1] + 1.0
        found.square = square
        found._fewer()
        return found

    assert len(with_ghost(0.9 * search.SATISFIED).fit.touch) == 2
    cured = with_ghost(1.1 * search.SATISFIED)
    assert cured.fit.touch[:, :2] == pytest.approx(np.array([[0.03, 0.04]]), abs=1e-3)
    assert cured.logs[1] > cured.logs[2]
