"""Causes of few numbers that a smooth field has taken the place of are told by what the field's covariance costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import small_problem
from scipy.stats import multivariate_normal
from small_problem import PARTITIONS, START, recorded

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search import behind_fields
from ertskin.diagnosis.search.behind_fields import behind_field, loss_with_fields, smooth_fields_of, spare_evidence
from ertskin.diagnosis.search.candidates import Direction
from ertskin.diagnosis.search.smooth_fields import (
    SPREADS,
    NodeQuadratic,
    covariances,
    node_shape,
    with_smooth_field,
)
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity

EXTENT_M = np.array([[0.0, 0.0], [0.02, 0.02]])
STRETCH = SheetAnisotropy(stretch_x=0.05)
SLOPE = SheetInhomogeneity(gradient_x=0.05)


@pytest.fixture(autouse=True)
def noisy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Readings two thousand times their noise, as instruments take them."""
    monkeypatch.setattr(small_problem, "NOISE_V", 5e-4)


def evened(hidden: Effect) -> tuple[VoltageProblem, Solved]:
    """Readings with one effect, and their fit by a smooth field of the sheet."""
    problem = recorded(hidden)
    solved = problem.solve([Term(SheetInhomogeneity(), ())], START, steps=0)
    for _ in range(2):
        solved = with_smooth_field(problem, solved, 0, PARTITIONS) or solved
    return problem, problem.solve(solved.terms, solved.calibration)


def test_a_stretch_is_found_behind_the_field_that_explains_it() -> None:
    problem, solved = evened(STRETCH)
    best = behind_field(problem, solved, 0)[0]
    assert best.name == STRETCH.name
    assert best.gain > DEFAULT.significant_gain
    assert best.term.effect.value("stretch_x") == pytest.approx(0.05, rel=0.2)


def test_behind_a_true_field_is_nothing() -> None:
    problem, solved = evened(SLOPE)
    assert all(one.gain < DEFAULT.significant_gain for one in behind_field(problem, solved, 0))


def test_what_a_direction_gains_is_marginal_likelihood() -> None:
    rng = np.random.default_rng(0)
    nodes = int(np.prod(node_shape(EXTENT_M)))
    field, added, calibration = rng.normal(size=(30, nodes)), rng.normal(size=(30, 3)), rng.normal(size=(30, 2))
    wrong = rng.normal(size=30) + added @ [0.4, -0.3, 0.0] + 0.03 * field @ rng.normal(size=nodes)
    columns = np.hstack([calibration, added, field])
    quadratic = NodeQuadratic(
        *np.zeros((3, 1)), (columns.T @ wrong)[None], (columns.T @ columns)[None], np.full(2, 4.0), np.zeros(2)
    )
    directions = [Direction(np.zeros((1, 1, count)), lambda value: None) for count in (2, 1)]  # type: ignore[arg-type,return-value]

    def most_likely(beside: np.ndarray) -> float:
        """Of the readings, calibration and field integrated out, ``beside`` at its best."""
        found = []
        for half in covariances(EXTENT_M):
            for spread in SPREADS:
                through = spread * field @ half
                covariance = np.eye(30) + through @ through.T + calibration @ calibration.T / 4.0
                inverse = np.linalg.inv(covariance)
                value = np.linalg.solve(beside.T @ inverse @ beside, beside.T @ inverse @ wrong)
                found.append(multivariate_normal(np.zeros(30), covariance).logpdf(wrong - beside @ value))
        return max(found)

    found = behind_fields._evidence_gained(*quadratic.reduced(), directions, EXTENT_M)
    for (gain, value), beside in zip(found, (added[:, :2], added[:, 2:]), strict=True):
        assert len(value) == beside.shape[1]
        assert gain == pytest.approx(most_likely(beside) - most_likely(np.zeros((30, 0))), abs=1e-6)


def test_a_share_below_nought_gains_nothing() -> None:
    nodes = int(np.prod(node_shape(EXTENT_M)))
    gradient, hessian = np.zeros(1 + nodes), np.eye(1 + nodes)
    gradient[0] = -8.0
    for positive, gain in ((False, 32.0), (True, 0.0)):
        direction = Direction(np.zeros((1, 1, 1)), lambda value: None, positive)  # type: ignore[arg-type,return-value]
        assert behind_fields._evidence_gained(gradient, hessian, [direction], EXTENT_M)[0][0] == pytest.approx(gain)


def test_a_field_of_another_covariance_could_be_likelier_by_what_it_spares() -> None:
    problem, solved = evened(SLOPE)
    modes = solved.terms[0].modes
    assert modes is not None
    spare = spare_evidence(problem, solved)
    wider = replace(solved.terms[0], modes=replace(modes, spread=SPREADS[-1]))
    assert 0 <= spare < spare_evidence(problem, problem.solve([wider], solved.calibration, steps=0))


def test_only_smooth_fields_spare_anything() -> None:
    problem = recorded(STRETCH)
    solved = problem.solve([Term(STRETCH, ("stretch_x",))], START)
    assert spare_evidence(problem, solved) == 0.0
    assert smooth_fields_of(solved) == []


def test_beside_a_field_a_term_is_worth_what_it_explains() -> None:
    problem, field = evened(STRETCH)
    both = problem.solve([Term(STRETCH, ("stretch_x",)), *field.terms], START)
    without = problem.solve(field.terms, both.calibration)
    worth = loss_with_fields(problem, both, without, 0)
    assert worth > 10 * max(without.cost - both.cost, 0.0)
    assert worth == both.rise_without(0, others_stay=True) > both.rise_without(0)


def test_a_term_that_makes_nothing_likelier_and_one_beside_no_field_are_worth_nothing_more() -> None:
    problem, field = evened(SLOPE)
    both = problem.solve([Term(replace(STRETCH, stretch_x=1e-4), ("stretch_x",)), *field.terms], START)
    assert loss_with_fields(problem, both, field, 0) == -np.inf
    alone = problem.solve(both.terms[:1], START)
    assert loss_with_fields(problem, alone, alone, 0) == -np.inf
