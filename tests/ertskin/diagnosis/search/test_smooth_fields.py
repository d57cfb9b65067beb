"""Processes over a sheet: gains held out, evidence, and what becomes of places that nothing tells of."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from ertskin.diagnosis.fit.joint_fit import Modes, Term
from ertskin.diagnosis.search import smooth_fields
from ertskin.diagnosis.search.smooth_fields import LENGTHS, NodeQuadratic, foretelling, likeliest, node_shape
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity
from ertskin.physics.effects.smooth_field import field_at, field_design, node_position_m

EXTENT_M = np.array([[0.0, 0.0], [0.06, 0.06]])
SHAPE = node_shape(EXTENT_M)
CELLS = 6


def seen(field: np.ndarray, places: np.ndarray, noise: float = 0.01, others: int = 2) -> NodeQuadratic:
    """A field (M,) read at places (N,2), cell by cell in turn, through unknown offsets too; in units of the noise."""
    rng = np.random.default_rng(1)
    design = field_design(SHAPE, places, EXTENT_M) / noise
    besides = rng.normal(size=(len(places), others)) / noise
    columns = np.hstack([besides, design])
    wrong = design @ field + besides @ np.full(others, 0.3) + rng.normal(size=len(places))
    cell = np.arange(len(places)) % CELLS
    parts = [(columns[cell == k], wrong[cell == k]) for k in range(CELLS)]
    gradient = np.stack([part.T @ left for part, left in parts])
    hessian = np.stack([part.T @ part for part, _ in parts])
    return NodeQuadratic(gradient, hessian, np.full(others, 1e-6), np.zeros(others))


def hill(radius_m: float) -> np.ndarray:
    apart = ((node_position_m(SHAPE, EXTENT_M) - 0.03) ** 2).sum(axis=1)
    return 0.2 * np.exp(-0.5 * apart / radius_m**2)


def places(count: int, most_x_m: float = 0.06) -> np.ndarray:
    return np.random.default_rng(2).uniform((0, 0), (most_x_m, 0.06), (count, 2))


PARTITIONS = [[k] for k in range(CELLS)]


def test_what_a_fold_gains_is_what_whole_newton_steps_gain() -> None:
    quadratic = seen(hill(0.012), places(60))
    modes = foretelling(quadratic, EXTENT_M, PARTITIONS).modes
    gain = sum(quadratic.fold(out).gain(modes) for out in PARTITIONS)
    assert gain == pytest.approx(quadratic.along(modes, 1.0, PARTITIONS)[0], rel=1e-6)


def test_evidence_is_the_marginal_likelihood() -> None:
    rng = np.random.default_rng(0)
    half, design = rng.normal(size=(8, 3)), rng.normal(size=(20, 8))
    wrong = rng.normal(size=20) * 2
    evidence = smooth_fields._evidences(half, design.T @ wrong, design.T @ design)
    plain = multivariate_normal(np.zeros(20), np.eye(20)).logpdf(wrong)
    for spread, found in zip(smooth_fields.SPREADS, evidence, strict=True):
        through = spread * design @ half
        expected = multivariate_normal(np.zeros(20), np.eye(20) + through @ through.T).logpdf(wrong) - plain
        assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("radius_m", "longest"), [(0.006, 0.3), (0.05, 3.0)])
def test_short_hills_take_short_lengths_and_wide_ones_long(radius_m: float, longest: float) -> None:
    process = foretelling(seen(hill(radius_m), places(150)), EXTENT_M, PARTITIONS)
    kinds = [length for length, _ in smooth_fields._kinds()]
    length = kinds[process.covariance][0]
    assert length <= longest
    assert (length >= 0.5) == (longest > 1)


def test_a_line_is_told_along_its_direction() -> None:
    across = node_position_m(SHAPE, EXTENT_M) @ np.array([np.cos(np.pi / 3), np.sin(np.pi / 3)]) - 0.04
    line = 0.2 * np.exp(-0.5 * (across / 0.005) ** 2)
    process = foretelling(seen(line, places(40)), EXTENT_M, PARTITIONS)
    assert process.covariance >= len(LENGTHS)
    angle = list(smooth_fields._kinds())[process.covariance][1]
    assert angle == pytest.approx(np.pi / 3, abs=np.pi / 12 + 1e-9)


def test_where_nothing_tells_the_field_stays_as_expected_beforehand() -> None:
    process = likeliest(seen(hill(0.01), places(80, 0.03)), EXTENT_M, 1.0, covariance=LENGTHS.index(0.13))
    term = process.of(Term(SheetInhomogeneity(), ()), EXTENT_M)
    at = np.array([[0.024, 0.03], [0.058, 0.03]])
    pressed, untouched = field_at(term.effect.nodes, at, EXTENT_M)  # type: ignore[attr-defined]
    assert pressed == pytest.approx(0.2 * np.exp(-0.5 * 0.6**2), abs=0.02)
    assert abs(untouched) < 0.02


def test_nothing_there_gains_nothing() -> None:
    quadratic = seen(np.zeros(SHAPE[0] * SHAPE[1]), places(60))
    assert foretelling(quadratic, EXTENT_M, PARTITIONS).gain < 5.0
    assert likeliest(quadratic, EXTENT_M, 1.0).gain < 5.0


def test_a_term_in_modes_moves_by_their_sizes() -> None:
    nodes = np.stack([np.ones((2, 2)), np.array([[0.0, 1.0], [0.0, 1.0]])])
    term = Term(SheetInhomogeneity(ridge=0.1), ("ridge",), Modes(nodes), (0.0, 0.0))
    moved = term.at([0.3, 1.0, -2.0])
    assert moved.start == [0.3, 1.0, -2.0]
    assert moved.effect == SheetInhomogeneity(ridge=0.3, nodes=((1.0, -1.0), (1.0, -1.0)))
    assert moved.nearer(0.5).start == [0.15, 0.5, -1.0]
    assert moved.nearer(0.5).effect == SheetInhomogeneity(ridge=0.15, nodes=((0.5, -0.5), (0.5, -0.5)))
