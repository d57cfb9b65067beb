"""What is known of a map: of smooth fields that presses alone show by their values where something has pressed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import FieldMap
from ertskin.diagnosis.judge import known_map
from ertskin.diagnosis.judge.known_map import CovarianceAt, SmoothPart, determined_points, smooth_part, where_pressed
from ertskin.diagnosis.judge.map_probability import Places
from ertskin.diagnosis.judge.quantities import field_map
from ertskin.diagnosis.judge.undetermined_field import Known
from ertskin.diagnosis.search.smooth_fields import node_shape
from ertskin.hardware.virtual.bench.nominal import nominal_sensor
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity
from ertskin.physics.effects.smooth_field import field_design

Array = NDArray[np.float64]

SENSOR = nominal_sensor()
SHAPE = node_shape(SENSOR.extent_m)
TAXELS = field_design(SHAPE, SENSOR.taxel_m, SENSOR.extent_m)


def through(value: Array) -> tuple[tuple[float, ...], ...]:
    """Nodes of a field that has these values (N,) at the sensing points."""
    nodes = np.linalg.lstsq(TAXELS, value, rcond=None)[0].reshape(SHAPE)
    return tuple(tuple(map(float, row)) for row in nodes)


def told(effect: PiezoInhomogeneity, pressed: Array, covariance_at: CovarianceAt = lambda point_m: None) -> FieldMap:
    """The sensing points' map of an effect, something having pressed at some of them (N,), a fit leaving this
    covariance."""
    field = field_map(effect, SENSOR)
    assert field is not None
    place_m = SENSOR.taxel_m[pressed]
    value = TAXELS[pressed] @ np.ravel(effect.nodes)
    smooth = SmoothPart(effect.nodes, SENSOR.extent_m, Places(place_m, value, np.full(len(value), 1e-3)), covariance_at)
    found = smooth.known(field).taxels
    assert found is not None
    return found


def test_what_has_no_order_is_unknown_where_nothing_has_pressed() -> None:
    value = 0.3 * np.random.default_rng(1).standard_normal(len(SENSOR.taxel_m))
    pressed = np.arange(len(value)) % 3 == 0
    found = told(PiezoInhomogeneity(nodes=through(value)), pressed)
    assert found.right_everywhere is not None
    assert found.right_everywhere < 0.1
    assert found.right == 1.0
    assert found.error is not None
    assert found.determined is not None
    assert found.error[pressed] == pytest.approx(0.0, abs=0.01)
    assert found.error[~pressed].min() > 0.3
    assert found.determined[pressed].all()
    assert not found.determined[~pressed].any()


def test_what_is_broad_is_known_from_few_places() -> None:
    x, y = ((SENSOR.taxel_m - SENSOR.extent_m.mean(axis=0)) / np.ptp(SENSOR.extent_m, axis=0)).T
    found = told(PiezoInhomogeneity(nodes=through(0.3 * np.cos(2 * x) * y)), np.arange(len(x)) % 2 == 0)
    assert found.right_everywhere is not None
    assert found.right_everywhere > 0.9


def test_a_form_of_few_numbers_holds_where_nothing_has_pressed() -> None:
    nodes = through(0.01 * np.random.default_rng(1).standard_normal(len(SENSOR.taxel_m)))
    pressed = np.arange(len(SENSOR.taxel_m)) % 3 == 0
    spot = PiezoInhomogeneity(amplitude=0.8, x_m=0.04, y_m=0.06, radius_m=0.02, nodes=nodes)
    alone = told(PiezoInhomogeneity(nodes=nodes), pressed).right_everywhere
    with_spot = told(spot, pressed).right_everywhere
    assert with_spot is not None
    assert alone is not None
    assert with_spot > 0.99
    assert alone < 0.1


def test_between_places_the_fit_has_a_say_as_they_have() -> None:
    nodes = through(0.3 * np.random.default_rng(1).standard_normal(len(SENSOR.taxel_m)))
    pressed = np.arange(len(SENSOR.taxel_m)) % 3 == 0
    by_places, by_both, doubted = (
        told(PiezoInhomogeneity(nodes=nodes), pressed, fitted)
        for fitted in (
            lambda point_m: None,
            lambda point_m: np.zeros((len(point_m), len(point_m))),
            lambda point_m: 9.0 * np.eye(len(point_m)),
        )
    )
    assert by_places.right_everywhere is not None
    assert by_both.right_everywhere == pytest.approx(0.5 + 0.5 * by_places.right_everywhere, abs=0.02)
    assert doubted.right_everywhere == pytest.approx(0.5 * by_places.right_everywhere, abs=0.02)
    assert by_both.error == pytest.approx(by_places.error)


def test_what_is_told_by_places_is_as_likely_right_as_both_say() -> None:
    nodes = through(0.3 * np.random.default_rng(1).standard_normal(len(SENSOR.taxel_m)))
    pressed = np.arange(len(SENSOR.taxel_m)) % 3 == 0
    field = field_map(PiezoInhomogeneity(nodes=nodes), SENSOR)
    assert field is not None
    place_m = SENSOR.taxel_m[pressed]
    places = Places(place_m, TAXELS[pressed] @ np.ravel(nodes), np.zeros(len(place_m)))
    by_both = where_pressed(field, places, 0.1, lambda point_m: np.zeros((len(point_m), len(point_m)))).taxels
    by_places = where_pressed(field, places, 0.1, lambda point_m: None).taxels
    assert by_both is not None
    assert by_places is not None
    assert by_places.right_everywhere is not None
    assert by_both.right_everywhere == pytest.approx(0.5 + 0.5 * by_places.right_everywhere, abs=0.02)
    assert by_both.right == by_places.right == 1.0


def selection_of(effect: Effect, pressed: Array, monkeypatch: pytest.MonkeyPatch) -> Any:
    """What a fit with this field has come to, all known to 0.001 as fitted, as far as a map asks for it."""
    monkeypatch.setattr(known_map, "pressed_places_m", lambda problem: SENSOR.taxel_m[pressed])
    monkeypatch.setattr(
        known_map,
        "known_at",
        lambda solved, extent_m, point_m: {effect.name: Known(1e-6 * np.eye(len(point_m)), np.full(len(point_m), 0.3))},
    )
    problem = SimpleNamespace(evidence=SimpleNamespace(sensor=SENSOR))
    term = SimpleNamespace(name=effect.name, effect=effect, modes="modes")
    return SimpleNamespace(problem=problem, after=SimpleNamespace(terms=[term]))


@pytest.mark.parametrize(
    ("kind", "everywhere"), [(PiezoInhomogeneity, False), (SheetInhomogeneity, True)], ids=["presses", "rest too"]
)
def test_what_presses_alone_show_is_half_as_sure_as_fitted(
    kind: type[PiezoInhomogeneity | SheetInhomogeneity], everywhere: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    effect = kind(nodes=through(0.3 * np.random.default_rng(1).standard_normal(len(SENSOR.taxel_m))))
    pressed = np.arange(len(SENSOR.taxel_m)) % 3 == 0
    selection = selection_of(effect, pressed, monkeypatch)
    points = len(SENSOR.taxel_m)
    assert determined_points(selection) == [(effect.name, points if everywhere else int(pressed.sum()), points)]
    field = field_map(effect, SENSOR)
    assert field is not None
    found = known_map.known_map(field, effect, selection).taxels
    assert found is not None
    assert found.right == 1.0
    assert found.right_everywhere == pytest.approx(1.0 if everywhere else 0.5, abs=0.05)


def test_of_two_places_a_field_is_as_sure_as_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    effect = PiezoInhomogeneity(nodes=through(SENSOR.taxel_m[:, 0]))
    assert smooth_part(effect, selection_of(effect, np.array([3, 7]), monkeypatch)) is None


@pytest.mark.parametrize(
    "effect", [SheetInhomogeneity(nodes=through(SENSOR.taxel_m[:, 0])), PiezoInhomogeneity(amplitude=0.3)]
)
def test_what_rest_shows_too_and_a_form_alone_are_known_as_fitted(effect: Effect) -> None:
    assert smooth_part(effect, SimpleNamespace()) is None  # type: ignore[arg-type]


def test_what_is_told_by_places_is_determined_next_to_them_alone() -> None:
    field = field_map(PiezoInhomogeneity(amplitude=0.5, x_m=0.04, y_m=0.06, radius_m=0.02), SENSOR)
    assert field is not None
    places = Places(SENSOR.taxel_m[[3, 7]] + 1e-3, np.array([0.1, 0.4]), np.zeros(2))
    found = where_pressed(field, places, 0.1, lambda point_m: None)
    assert found.taxels is not None
    assert found.taxels.determined is not None
    assert np.flatnonzero(found.taxels.determined).tolist() == [3, 7]
    assert found.determined is not None
    assert found.determined.sum() < 0.05 * len(found.determined)
