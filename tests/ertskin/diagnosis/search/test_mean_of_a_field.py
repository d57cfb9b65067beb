"""A smooth field has a mean of its own only where the calibration can't make up for it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_problem import PARTITIONS, START, recorded

from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.judge.undetermined_field import known_at
from ertskin.diagnosis.search.smooth_fields import NodeQuadratic, Process, covariance_half, predictive
from ertskin.physics.effects.field_over_sheet import FieldOverSheet
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.registry import effect_classes
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity

FIELDS = [kind for kind in effect_classes().values() if issubclass(kind, FieldOverSheet)]
HIDDEN: dict[type[FieldOverSheet], FieldOverSheet] = {
    kind: kind(amplitude=0.3, x_m=0.03, y_m=0.03, radius_m=0.02) for kind in (SheetInhomogeneity, PiezoInhomogeneity)
}


@pytest.mark.parametrize("kind", FIELDS)
def test_the_calibration_makes_up_for_a_mean_where_the_effect_says_so(kind: type[FieldOverSheet]) -> None:
    problem, rows, evenly = recorded(), np.arange(4), 0.2
    lower = replace(START, zero_ohm_sq=START.zero_ohm_sq * np.exp(-evenly))
    raised = problem.in_full(problem.solve([Term(kind().raised(evenly), ())], lower, steps=0), rows)
    alone = problem.in_full(problem.solve([], START, steps=0), rows)
    assert np.allclose(raised, alone, rtol=1e-9) is not kind.has_a_mean


@pytest.mark.parametrize("kind", FIELDS)
def test_nothing_is_determined_before_any_reading(kind: type[FieldOverSheet]) -> None:
    sensor = recorded().evidence.sensor
    extent_m, half = sensor.extent_m, covariance_half(sensor.extent_m, 2.0)
    count = half.shape[1]
    (term, *_) = Process(half, 0.1, 0.1 * half, np.zeros(count), 0.0).of(Term(kind(), ()), extent_m)
    unknown = SimpleNamespace(
        terms=[term],
        scan_residual=np.zeros((1, 1)),
        fit=SimpleNamespace(covariance=np.eye(count)),
        sizes=lambda number: slice(0, count),
    )
    known = known_at(unknown, extent_m, sensor.taxel_m)[kind.name]  # type: ignore[arg-type]
    assert known.error == pytest.approx(known.spread)
    assert not known.determined.any()


@pytest.mark.parametrize("kind", FIELDS)
def test_modes_have_a_mean_where_the_effect_has_one(kind: type[FieldOverSheet]) -> None:
    problem = recorded(HIDDEN[kind])
    current, extent_m = problem.at_hand(problem.solve([], START)), problem.evidence.sensor.extent_m
    process = predictive(NodeQuadratic.of(problem, current, (kind(),), 0), extent_m, PARTITIONS)
    for term in process.of(Term(kind(), ()), extent_m):
        assert term.modes is not None
        modes = term.modes.nodes.reshape(len(term.modes.nodes), -1)
        largest = np.abs(modes).max()
        even = np.abs(modes.mean(axis=1)).max(), np.abs(term.modes.half.mean(axis=0)).max()
        assert bool(max(even) < 1e-12 * largest) is not kind.has_a_mean
