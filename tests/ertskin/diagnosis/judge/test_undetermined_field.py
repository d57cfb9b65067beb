"""What a field may be where nothing was pressed speaks against no other name; what presses show otherwise does."""

from __future__ import annotations

import numpy as np
import pytest
from small_problem import START, recorded

from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.judge.undetermined_field import covariance_elsewhere, ratio_with_what_is_unknown
from ertskin.diagnosis.search.pressed_places import logarithms, modes_at, pressed_places_m
from ertskin.diagnosis.search.smooth_fields import node_shape
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.smooth_field import field_design


def lots(*value: float) -> PiezoInhomogeneity:
    """A field of these logarithms, nought on the mean, at the four places pressed."""
    problem = recorded()
    extent_m, place_m = problem.evidence.sensor.extent_m, pressed_places_m(problem)
    modes = modes_at(place_m, 1.0, extent_m)
    single = np.eye(len(modes.nodes))
    each = [logarithms(PiezoInhomogeneity(nodes=modes.of(list(one))), place_m, extent_m) for one in single]
    return PiezoInhomogeneity(nodes=modes.of(list(np.linalg.lstsq(np.transpose(each), np.array(value))[0])))


def test_a_field_is_known_where_it_was_pressed_and_as_unknown_as_places_differ_elsewhere() -> None:
    extent_m = recorded().evidence.sensor.extent_m
    field, place_m = lots(0.02, 0.018, -0.02, -0.018), pressed_places_m(recorded())
    covariance = covariance_elsewhere(field, place_m, extent_m)
    pressed = field_design(node_shape(extent_m), place_m, extent_m)
    spread = np.std(logarithms(field, place_m, extent_m))
    assert np.sqrt(np.abs(np.diag(pressed @ covariance @ pressed.T))) == pytest.approx(0.0, abs=1e-6)
    # A corner of the sheet, the farthest from all of them.
    assert np.sqrt(covariance[0, 0]) == pytest.approx(spread, rel=0.1)


def left_at_places_not_fitted(hidden: Effect) -> tuple[float, float]:
    """The misfit over noise where lots are known at two of the places pressed and nothing else is, the calibration as
    with all there is, and the same where what isn't known of the lots counts as noise."""
    problem = recorded(hidden)
    calibration = problem.solve([Term(hidden, ())], START).calibration
    solved = problem.solve([Term(lots(0.02, 0.018, 0.0, -0.038), ())], calibration, steps=0)
    place_m = pressed_places_m(problem)
    after = problem.scan_residual(problem.family.skin(solved.calibration, solved.effects))
    known = ratio_with_what_is_unknown(problem, solved, after, place_m[:2])
    return float(np.sqrt((after**2).mean())), known


def test_lots_elsewhere_speak_against_nothing() -> None:
    left, known = left_at_places_not_fitted(lots(0.02, 0.018, -0.02, -0.018))
    assert left > 10
    assert known**2 - 1 < 0.01 * (left**2 - 1)


def test_a_loop_is_seen_whatever_the_lots_are_elsewhere() -> None:
    left, known = left_at_places_not_fitted(PiezoHysteresis(width=0.1))
    assert known**2 - 1 > 0.5 * (left**2 - 1)
