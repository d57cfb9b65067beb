"""What is known of a map: of smooth fields that presses alone show by their values where something has pressed."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import FieldMap
from ertskin.diagnosis.judge.known_map import Departure, departing, where_pressed
from ertskin.diagnosis.judge.map_probability import FOLLOWS, Places
from ertskin.diagnosis.judge.quantities import field_map
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


def told(effect: PiezoInhomogeneity, pressed: Array) -> FieldMap:
    """The sensing points' map of an effect, something having pressed at some of them (N,)."""
    field = field_map(effect, SENSOR)
    assert field is not None
    place_m = SENSOR.taxel_m[pressed]
    value = TAXELS[pressed] @ np.ravel(effect.nodes)
    departure = Departure(effect.nodes, SENSOR.extent_m, Places(place_m, value, np.full(len(value), 1e-3)))
    found = departure.told(field).taxels
    assert found is not None
    return found


def test_what_has_no_order_is_unknown_where_nothing_has_pressed() -> None:
    value = 0.3 * np.random.default_rng(1).standard_normal(len(SENSOR.taxel_m))
    pressed = np.arange(len(value)) % 3 == 0
    found = told(PiezoInhomogeneity(nodes=through(value)), pressed)
    assert found.right is not None
    assert found.right < 0.1
    assert found.error is not None
    assert found.determined is not None
    assert found.error[pressed] == pytest.approx(0.0, abs=0.01)
    assert found.error[~pressed].min() > 0.3
    assert found.determined[pressed].all()
    assert not found.determined[~pressed].any()


def test_what_is_broad_is_known_from_few_places() -> None:
    x, y = ((SENSOR.taxel_m - SENSOR.extent_m.mean(axis=0)) / np.ptp(SENSOR.extent_m, axis=0)).T
    found = told(PiezoInhomogeneity(nodes=through(0.3 * np.cos(2 * x) * y)), np.arange(len(x)) % 2 == 0)
    assert found.right is not None
    assert found.right > 0.9


def test_a_form_of_few_numbers_holds_where_nothing_has_pressed() -> None:
    value = 0.01 * np.random.default_rng(1).standard_normal(len(SENSOR.taxel_m))
    spot = PiezoInhomogeneity(amplitude=0.8, x_m=0.04, y_m=0.06, radius_m=0.02, nodes=through(value))
    found = told(spot, np.arange(len(value)) % 3 == 0)
    assert found.right is not None
    assert found.right > 0.99
    assert np.corrcoef(found.value, spot.logarithm(SENSOR.taxel_m, SENSOR.extent_m))[0, 1] > FOLLOWS


def test_two_places_tell_no_map() -> None:
    found = told(PiezoInhomogeneity(nodes=through(np.linspace(0.0, 0.3, len(SENSOR.taxel_m)))), np.array([3, 7]))
    assert found.right == 0.0
    assert found.determined is not None
    assert not found.determined.any()


@pytest.mark.parametrize(
    "effect", [SheetInhomogeneity(nodes=through(SENSOR.taxel_m[:, 0])), PiezoInhomogeneity(amplitude=0.3)]
)
def test_what_rest_shows_too_and_a_form_alone_are_known_as_fitted(effect: Effect) -> None:
    assert departing(effect, SimpleNamespace()) is None  # type: ignore[arg-type]


def test_what_is_told_by_places_is_determined_next_to_them_alone() -> None:
    field = field_map(PiezoInhomogeneity(amplitude=0.5, x_m=0.04, y_m=0.06, radius_m=0.02), SENSOR)
    assert field is not None
    found = where_pressed(field, Places(SENSOR.taxel_m[[3, 7]] + 1e-3, np.array([0.1, 0.4]), np.zeros(2)), 0.1)
    assert found.taxels is not None
    assert found.taxels.determined is not None
    assert np.flatnonzero(found.taxels.determined).tolist() == [3, 7]
    assert found.determined is not None
    assert found.determined.sum() < 0.05 * len(found.determined)
