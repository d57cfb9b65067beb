"""Processes over a sheet: gains held out, evidence, and what becomes of places that nothing tells of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from small_problem import START, recorded

from ertskin.diagnosis.fit import joint_fit
from ertskin.diagnosis.fit.terms import Modes, Term
from ertskin.diagnosis.search import smooth_fields
from ertskin.diagnosis.search.smooth_fields import LENGTHS, NodeQuadratic, node_shape, predictive
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
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
    cost = np.array([0.5 * left @ left for _, left in parts])
    numbers = np.array([len(left) for _, left in parts], dtype=float)
    return NodeQuadratic(cost, numbers, numbers, gradient, hessian, np.full(others, 1e-6), np.zeros(others))


def hill(radius_m: float) -> np.ndarray:
    apart = ((node_position_m(SHAPE, EXTENT_M) - 0.03) ** 2).sum(axis=1)
    return 0.2 * np.exp(-0.5 * apart / radius_m**2)


def places(count: int, most_x_m: float = 0.06) -> np.ndarray:
    return np.random.default_rng(2).uniform((0, 0), (most_x_m, 0.06), (count, 2))


PARTITIONS = [[k] for k in range(CELLS)]


def test_what_a_fold_gains_is_what_whole_newton_steps_gain() -> None:
    quadratic = seen(hill(0.012), places(60))
    modes = predictive(quadratic, EXTENT_M, PARTITIONS).modes
    gain = sum(quadratic.fold(out).gain(modes) for out in PARTITIONS)
    assert gain == pytest.approx(quadratic.along(modes, 1.0, PARTITIONS)[0], rel=1e-6)


def test_what_a_fold_costs_is_what_is_left_of_its_readings() -> None:
    quadratic = seen(hill(0.012), places(60))
    modes = predictive(quadratic, EXTENT_M, PARTITIONS).modes
    fold = quadratic.fold([2])
    inside = np.arange(CELLS) != 2
    onto = np.zeros((quadratic.gradient.shape[1], 2 + modes.shape[1]))
    onto[:2, :2], onto[2:, 2:] = np.eye(2), modes
    for free in (onto, onto[:, :2]):
        prior = np.where(np.arange(free.shape[1]) < 2, 1e-6, 1.0)
        curved = free.T @ quadratic.hessian[inside].sum(axis=0) @ free + np.diag(prior)
        step = free @ np.linalg.solve(curved, free.T @ quadratic.gradient[inside].sum(axis=0))
        left = quadratic.cost[2] - quadratic.gradient[2] @ step + 0.5 * step @ quadratic.hessian[2] @ step
        gain = fold.gain(modes) if free is onto else 0.0
        assert fold.out_cost - gain == pytest.approx(left, rel=1e-6)


def one_cell_apart(seed: int) -> NodeQuadratic:
    """Small short hills read by five cells on the left, and a high edge on the right that the sixth alone reads."""
    rng = np.random.default_rng(seed)
    node = node_position_m(SHAPE, EXTENT_M)
    apart = ((node[:, None] - rng.uniform((0, 0), (0.04, 0.06), (5, 2))) ** 2).sum(axis=-1)
    field = 0.05 * np.exp(-0.5 * apart / 0.008**2) @ rng.choice([-1.0, 1.0], 5)
    field += 1.0 * np.clip((node[:, 0] - 0.04) / 0.02, 0, 1) ** 2
    at = rng.uniform((0, 0), (0.04, 0.06), (60, 2))
    at[::CELLS] = rng.uniform((0.05, 0), (0.06, 0.06), (10, 2))
    return seen(field, at)


def test_a_cell_that_no_other_tells_of_does_not_choose_the_field(monkeypatch: pytest.MonkeyPatch) -> None:
    def gains() -> list[float]:
        found = []
        for seed in range(6):
            quadratic = one_cell_apart(seed)
            modes = predictive(quadratic, EXTENT_M, PARTITIONS).modes
            found.append(sum(quadratic.fold([k]).gain(modes) for k in range(1, CELLS)))
        return found

    on_their_own_scale = gains()
    monkeypatch.setattr(smooth_fields, "log_misfit", lambda cost, numbers: float(cost.sum()))
    monkeypatch.setattr(smooth_fields, "log_misfits", lambda cost, numbers: cost / numbers)
    assert np.mean(on_their_own_scale) > 1.1 * np.mean(gains())


def test_evidence_is_the_marginal_likelihood() -> None:
    rng = np.random.default_rng(0)
    half, design = rng.normal(size=(8, 3)), rng.normal(size=(20, 8))
    wrong = rng.normal(size=20) * 2
    evidence = smooth_fields.evidences(half, design.T @ wrong, design.T @ design)
    without = multivariate_normal(np.zeros(20), np.eye(20)).logpdf(wrong)
    for spread, found in zip(smooth_fields.SPREADS, evidence, strict=True):
        through = spread * design @ half
        expected = multivariate_normal(np.zeros(20), np.eye(20) + through @ through.T).logpdf(wrong) - without
        assert found == pytest.approx(expected, rel=1e-9)


def correlation(half: np.ndarray, apart_m: tuple[float, float]) -> float:
    """Of a process about the sheet's middle, at two places so far from one another."""
    at = 0.03 + np.array([[-0.5], [0.5]]) * apart_m
    design = field_design(SHAPE, at, EXTENT_M) @ half
    covariance = design @ design.T
    return float(covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]))


@pytest.mark.parametrize(("radius_m", "least", "most"), [(0.006, 0.0, 0.3), (0.05, 0.8, 1.0)])
def test_short_hills_take_short_lengths_and_wide_ones_long(radius_m: float, least: float, most: float) -> None:
    process = predictive(seen(hill(radius_m), places(150)), EXTENT_M, PARTITIONS)
    assert least < correlation(process.half, (0.02, 0.0)) < most


def test_a_line_is_found_along_its_direction() -> None:
    normal = np.array([np.cos(np.pi / 3), np.sin(np.pi / 3)])
    across = node_position_m(SHAPE, EXTENT_M) @ normal - 0.04
    line = 0.2 * np.exp(-0.5 * (across / 0.005) ** 2)
    process = predictive(seen(line, places(40)), EXTENT_M, PARTITIONS)
    dx, dy = 0.02 * normal
    assert correlation(process.half, (-dy, dx)) > 0.7
    assert correlation(process.half, (dx, dy)) < 0.3


def test_covariances_count_by_how_well_they_predict(monkeypatch: pytest.MonkeyPatch) -> None:
    # Which one eight presses on three hills predict one another with best is much by chance.
    among = smooth_fields._likely

    def followed(process: smooth_fields.Process) -> float:
        return float(np.corrcoef(process.modes @ process.sizes, true)[0, 1])

    def alone(number: int) -> smooth_fields.Process:
        monkeypatch.setattr(smooth_fields, "_likely", lambda *given: [number])
        return predictive(quadratic, EXTENT_M, PARTITIONS)

    by_mean, by_best = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        apart = node_position_m(SHAPE, EXTENT_M)[:, None] - rng.uniform(0, 0.06, (3, 2))
        radius_m = rng.uniform(0.006, 0.012)
        true = 0.2 * np.exp(-0.5 * (apart**2).sum(axis=-1) / radius_m**2) @ rng.choice([-1.0, 1.0], 3)
        quadratic = seen(true, rng.uniform(0, 0.06, (8, 2)), noise=0.002)
        monkeypatch.setattr(smooth_fields, "_likely", among)
        by_mean.append(followed(predictive(quadratic, EXTENT_M, PARTITIONS)))
        numbers = among(smooth_fields.covariances(EXTENT_M), *quadratic.reduced())
        by_best.append(followed(max(map(alone, numbers), key=lambda process: process.gain)))
    assert np.mean(by_mean) > np.mean(by_best) + 0.03


def test_where_nothing_tells_the_field_stays_as_expected_beforehand() -> None:
    process = predictive(seen(hill(0.01), places(80, 0.03)), EXTENT_M, PARTITIONS)
    # One of the sheet would leave its mean to a calibration, which these readings are without.
    term, *_ = process.of(Term(PiezoInhomogeneity(), ()), EXTENT_M)
    at = np.array([[0.024, 0.03], [0.058, 0.03]])
    pressed, untouched = field_at(term.effect.nodes, at, EXTENT_M)  # type: ignore[attr-defined]
    assert pressed == pytest.approx(0.2 * np.exp(-0.5 * 0.6**2), abs=0.02)
    assert abs(untouched) < 0.04


def test_nothing_there_gains_nothing() -> None:
    quadratic = seen(np.zeros(SHAPE[0] * SHAPE[1]), places(60))
    assert predictive(quadratic, EXTENT_M, PARTITIONS).gain < 5.0


def test_a_term_in_modes_moves_by_their_sizes() -> None:
    nodes = np.stack([np.ones((2, 2)), np.array([[0.0, 1.0], [0.0, 1.0]])])
    term = Term(SheetInhomogeneity(ridge=0.1), ("ridge",), Modes(nodes), (0.0, 0.0))
    moved = term.at([0.3, 1.0, -2.0])
    assert moved.start == [0.3, 1.0, -2.0]
    assert moved.effect == SheetInhomogeneity(ridge=0.3, nodes=((1.0, -1.0), (1.0, -1.0)))
    assert moved.nearer(0.5).start == [0.15, 0.5, -1.0]
    assert moved.nearer(0.5).effect == SheetInhomogeneity(ridge=0.15, nodes=((0.5, -0.5), (0.5, -0.5)))


def pressed(at: np.ndarray, tail_m: float) -> np.ndarray:
    """(N,8,M) what eight numbers of a press at each place (N,2) are told by the field under it and, faintly, far off
    where pressure falls with ``tail_m``, in units of the noise."""
    apart = np.linalg.norm(at[:, None] - node_position_m(SHAPE, EXTENT_M), axis=-1)
    under, far = np.exp(-0.5 * (apart / 0.006) ** 2), 0.05 * np.exp(-apart / tail_m)
    mixed = np.random.default_rng(3).normal(size=(8, apart.shape[1]))
    close = (under / under.sum(axis=1, keepdims=True))[:, None] * (1 + 0.1 * mixed)
    return (close + far[:, None] * mixed) / 1e-3


def hills(rng: np.random.Generator) -> np.ndarray:
    """(M,) six hills of either sign, of 3 % or so."""
    apart = node_position_m(SHAPE, EXTENT_M)[:, None] - rng.uniform(0, 0.06, (6, 2))
    return np.exp(-0.5 * (apart**2).sum(axis=-1) / 0.025**2) @ rng.normal(scale=0.03, size=6)


def errors_between_presses(seed: int) -> tuple[float, float]:
    """Errors of the field that cells held out choose, and of the likeliest one, at presses not seen; over the field."""
    rng = np.random.default_rng(seed)
    field, at = hills(rng), rng.uniform(0, 0.06, (30, 2))
    true, model = pressed(at, 0.012), pressed(at, 0.010)
    wrong = true @ (1 + field) - model.sum(axis=-1) + rng.normal(size=true.shape[:2])
    cells = [np.arange(k, 20, CELLS) for k in range(CELLS)]
    gradient = np.stack([np.einsum("nrm,nr->m", model[cell], wrong[cell]) for cell in cells])
    hessian = np.stack([np.einsum("nrm,nrk->mk", model[cell], model[cell]) for cell in cells])
    cost = np.array([0.5 * (wrong[cell] ** 2).sum() for cell in cells])
    numbers, presses = np.array([[wrong[cell].size, len(cell)] for cell in cells], dtype=float).T
    quadratic = NodeQuadratic(cost, numbers, presses, gradient, hessian, np.zeros(0), np.zeros(0))
    process = predictive(quadratic, EXTENT_M, PARTITIONS)
    half = smooth_fields.covariances(EXTENT_M)[LENGTHS.index(0.5)]
    summed = gradient.sum(axis=0), hessian.sum(axis=0)
    wide = smooth_fields.SPREADS[int(smooth_fields.evidences(half, *summed).argmax())]
    modes, sizes = smooth_fields._informed_modes(half, wide, *summed)
    new = field_design(SHAPE, at[20:], EXTENT_M)
    size = float(np.sqrt(np.mean((new @ field) ** 2)))
    found = (process.modes @ process.sizes, modes @ sizes)
    chosen, likeliest = (float(np.sqrt(np.mean((new @ (each - field)) ** 2))) / size for each in found)
    return chosen, likeliest


def test_a_wrong_tail_of_the_pressure_widens_no_field() -> None:
    chosen, likeliest = np.array([errors_between_presses(seed) for seed in range(8)]).T
    assert np.median(chosen) < 0.6
    assert np.median(likeliest) > 2.0


def test_a_field_that_first_order_takes_too_far_is_begun_where_a_spot_may_go() -> None:
    process = predictive(seen(100 * hill(0.012), places(60)), EXTENT_M, PARTITIONS)
    assert np.abs(process.modes @ process.sizes).max() > 10
    (term,) = process.of(Term(SheetInhomogeneity(), ()), EXTENT_M)
    assert np.abs(term.effect.nodes).max() == pytest.approx(smooth_fields.FARTHEST)  # type: ignore[attr-defined]


def test_no_fit_goes_to_fields_that_no_fabric_has() -> None:
    effects = (SheetInhomogeneity(amplitude=1.0), SheetInhomogeneity(nodes=((0.1, -6.0), (0.0, 0.2))))
    assert joint_fit._varies_most(effects) == 6.0
    assert joint_fit._varies_most(effects[:1]) == 0.0
    assert smooth_fields.FARTHEST < joint_fit.MOST_FIELD < 6.0


def test_each_press_counts_once_in_its_cell_and_air_not_at_all() -> None:
    problem = recorded()
    history = problem.evidence.history
    in_air = np.where(history.touched.any(axis=1), history.press, 9)
    assert (in_air == 9).any()
    evidence = replace(problem.evidence, history=replace(history, press=in_air))
    for cells, presses in ((problem.cells, [1.0, 1.0, 1.0, 1.0, 0.0]), (problem.cells // 2, [2.0, 2.0, 0.0])):
        part = replace(problem, evidence=evidence, cells=cells)
        begun = part.at_hand(part.solve([], START))
        assert NodeQuadratic.of(part, begun, (SheetInhomogeneity(),), 0).presses.tolist() == presses
