"""What columns beside a fit would gain, held out, to first order: the screen every candidate passes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.physics.effects.effect import AcquisitionEffect

Array = NDArray[np.float64]


def added_gain(
    problem: VoltageProblem,
    solved: Solved,
    columns: Array,
    base: Array,
    specimen: Array,
    specimen_columns: Array,
    partitions: Sequence[Sequence[int]],
) -> tuple[float, Array]:
    """First-order held-out gain in half chi-square of adding columns (T,P,c) to the fit, and their coefficients."""
    gradient, hessian = with_columns(problem, solved, columns, base, specimen, specimen_columns)
    prior = np.concatenate([solved.fit.prior.diagonal(), np.zeros(columns.shape[-1])])
    gain, step = held_out_gain(gradient, hessian, prior, solved.fit.from_prior, partitions)
    return gain, step[len(solved.fit.value) :]


def held_out_gain(
    gradient: Array, hessian: Array, prior: Array, value: Array, partitions: Sequence[Sequence[int]]
) -> tuple[float, Array]:
    """Held-out gain of numbers added behind those of a fit, ``value`` (n,) from the prior, and the step (n+c,) of all.

    From gradient (F,n+c) and Hessian (F,n+c,n+c) by cell and the ``prior``'s precisions (n+c,).
    """
    predicted, _, step = held_out_gains(gradient, hessian, prior, value, partitions)
    return float(predicted.sum()), step


def held_out_gains(
    gradient: Array, hessian: Array, prior: Array, value: Array, partitions: Sequence[Sequence[int]]
) -> tuple[Array, Array, Array]:
    """What each of k ``partitions`` gains held out, (k,), and fitted, (k,), and the step (n+c,) of all."""
    cells, count = np.arange(len(gradient)), len(value)
    pull = prior * np.concatenate([value, np.zeros(len(prior) - count)])

    def steps(inside: NDArray[np.bool_]) -> tuple[Array, Array]:
        wanted, curved = gradient[inside].sum(axis=0) - pull, hessian[inside].sum(axis=0) + np.diag(prior)
        return _newton(wanted, curved), _newton(wanted[:count], curved[:count, :count])

    def gained(out: Sequence[int], full: Array, small: Array) -> float:
        slope, curved = gradient[list(out)].sum(axis=0), hessian[list(out)].sum(axis=0)
        without = slope[:count] @ small - 0.5 * small @ curved[:count, :count] @ small
        return float(slope @ full - 0.5 * full @ curved @ full - without)

    whole = steps(np.ones(len(cells), dtype=bool))
    predicted = [gained(out, *steps(~np.isin(cells, out))) for out in partitions]
    return np.array(predicted), np.array([gained(out, *whole) for out in partitions]), whole[0]


def with_columns(
    problem: VoltageProblem,
    solved: Solved,
    columns: Array,
    base: Array,
    specimen: Array | None = None,
    specimen_columns: Array | None = None,
) -> tuple[Array, Array]:
    """Gradient (F,n+c) and Hessian (F,n+c,n+c) of the fit by cell, the columns (T,P,c) added behind."""
    quadratic = solved.fit.quadratic
    added = columns.shape[-1]
    count = len(solved.fit.value)
    cells = len(quadratic.cost)
    gradient = np.zeros((cells, count + added))
    hessian = np.zeros((cells, count + added, count + added))
    gradient[:, :count] = quadratic.gradient
    hessian[:, :count, :count] = quadratic.hessian
    known, known_specimen = problem.last_columns

    def add(cell: int, old: Array, new: Array, wrong: Array) -> None:
        gradient[cell, count:] = new.T @ wrong
        hessian[cell, count:, count:] = new.T @ new
        cross = old.T.astype(float) @ new
        hessian[cell, :count, count:] = cross
        hessian[cell, count:, :count] = cross.T

    for cell in range(problem.cell_count):
        mine = (problem.cells == cell) & (problem.weight > 0)
        if mine.any():
            add(cell, known[mine].reshape(-1, count), columns[mine].reshape(-1, added), base[mine].ravel())
    if specimen is not None and specimen_columns is not None and len(specimen):
        add(-1, known_specimen, specimen_columns, specimen)
    return gradient, hessian


Moved = Callable[[NDArray[np.bool_]], Array]
"""What columns add to the readings of some frames that no network gives: (n,K*M,c) volt of those of a mask."""


def beyond_networks(problem: VoltageProblem, solved: Solved, forms: Sequence[AcquisitionEffect]) -> Moved:
    """What each of the ``forms`` adds to the fit's readings that no network gives."""
    signal = problem.acquisition
    readings = signal.readings(problem.family.skin(solved.calibration, solved.effects))
    return lambda mine: np.stack([signal.beyond_networks(form, readings[mine]) for form in forms], axis=-1)


def add_leftover(problem: VoltageProblem, solved: Solved, moved: Moved, gradient: Array, hessian: Array) -> None:
    """Count what no network explains in the gradient and Hessian, whose last numbers are those of the columns."""
    signal, share = problem.acquisition, problem.leftover_share
    wrong = signal.residual(problem.family.skin(solved.calibration, solved.effects))
    taken = problem.evidence.leftover_v[signal.rows].reshape(len(signal.rows), -1) != 0
    cells = problem.cells[signal.rows]
    for cell in np.unique(cells):
        mine = cells == cell
        columns = moved(mine)
        where = slice(-columns.shape[-1], None)
        columns = np.where(taken[mine][..., None], columns, 0.0)
        flat = columns.reshape(-1, columns.shape[-1]) / problem.evidence.leftover_noise_v
        curved = hessian[cell]
        gradient[cell, where] += share * (flat.T @ wrong[mine].ravel())
        curved[where, where] += share * (flat.T @ flat)
        if problem.last_leftover is not None:
            which, own = problem.last_leftover
            cross = flat.T @ own[:, mine].reshape(len(which), len(flat)).T
            curved[where, which] += share * cross
            curved[which, where] += share * cross.T


def _newton(gradient: Array, hessian: Array) -> Array:
    scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    return np.asarray(np.linalg.lstsq(hessian / scale[:, None] / scale, gradient / scale, rcond=1e-10)[0] / scale)
