"""What the real skin does beyond the simulator, carried from the places pressed to those in between.

A response changes from place to place far more than what is wrong with it: residuals of two places can't be averaged.
So each press is compared in the frame of its own response, by how much stronger it was than simulated, how far shifted,
how much wider and longer. These few numbers vary slowly over the sheet and with force, and a Gaussian process takes
them to every place (Kennedy & O'Hagan, J. R. Stat. Soc. B 63 (2001) 425). How well it does is measured by leaving out
each place in turn. It has no name and explains nothing; a diagnosis does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from ertskin.data.touch_model import ModelError
from ertskin.physics.touch.posterior import SHAPE_M
from ertskin.physics.touch.table import ResponseTable

Array = NDArray[np.float64]

MODES = ("size", "x", "y", "xx", "yy", "xy")
LENGTHS_M = (8e-3, 16e-3, 32e-3, 64e-3, 128e-3)
FORCE_LENGTH = 0.8
"""Correlation length in the logarithm of the force."""
FINER_FORCES = 2
"""Times as many forces as the response was solved at: what is added bends more, where touches are light."""
COMMON = 0.25
"""Share of the process's variance that is the same all over the sheet: a law or a modulus that is off."""
EXPECTED = 0.1
"""What each number may be before anything is known, and what is assumed of an error that can't be measured: with fewer
places than ``FEWEST`` none can be left out."""
VARIANCES = tuple(float(EXPECTED**2 * 10.0**power) for power in range(-4, 3))
SCATTERS = (0.0, 0.01**2, 0.02**2, 0.04**2, 0.08**2, 0.16**2)
"""Variances by which the numbers of one press may differ from what its place would show again and again: a stage lands
beside its place, a force comes through as more or less."""
ENOUGH = 16
"""Places from which on scatter is looked for. With six on `rig_a` it took what is the places' own, and
forces came out 0.56 N wrong instead of 0.21, with twelve gridded ones 0.39 instead of 0.12."""
FEWEST = 4
BEND = 3
"""Degree of the curve over the logarithm of the force that the frames of one press are held against."""


class Process(NamedTuple):
    """Of one number: correlation length over the sheet, variance, and variance from press to press."""

    length_m: float
    variance: float
    scatter: float


def unknown_error() -> ModelError:
    """Of a response that no press was compared with."""
    return ModelError(np.full(3, EXPECTED), 0.0, np.array([EXPECTED * SHAPE_M, EXPECTED * SHAPE_M, EXPECTED]))


@dataclass(frozen=True, eq=False)
class LocalDiscrepancy:
    """Gaussian process of the six ``MODES`` over place and force, from presses at (N,2) with (N,) newton.

    ``weight`` (N,6), ``length_m`` (6,), ``variance`` (6,); ``left_out`` (N,6): each press's numbers as the presses of
    other places tell them. ``scatter`` (6,): variance from press to press, which is not carried anywhere.
    """

    contact_m: Array
    force_n: Array
    weight: Array
    length_m: Array
    variance: Array
    left_out: Array
    scatter: Array

    @classmethod
    def fit(
        cls, table: ResponseTable, contact_m: Array, force_n: Array, press: NDArray[np.int64], seen: Array
    ) -> tuple[LocalDiscrepancy, ModelError]:
        """From what frames (N,) of presses numbered ``press`` showed, ``seen`` (N,D) in the table's coordinates, in
        units of the noise."""
        basis = modes(table, contact_m, force_n)
        residual = seen - table.alone(contact_m, force_n)
        numbers, noise = coefficients(basis, residual)
        noise = noise + frame_scatter(force_n, press, numbers, noise)
        place, number = np.unique(contact_m, axis=0, return_inverse=True)
        groups = [np.flatnonzero(number.ravel() == k) for k in range(len(place))]
        chosen = [_process(contact_m, force_n, press, numbers[:, m], noise[:, m], groups) for m in range(len(MODES))]
        length_m, variance, scatter = np.array([c[:3] for c in chosen]).T
        weight, left_out = (np.stack([c[k] for c in chosen], axis=1) for k in (3, 4))
        found = cls(contact_m, force_n, weight, length_m, variance, left_out, scatter)
        return found, _model_error(basis, residual, numbers, noise, left_out, len(place), table, contact_m, force_n)

    def at(self, contact_m: Array, force_n: Array) -> Array:
        """(N,6) the numbers at other places (N,2) and forces (N,)."""
        apart = Apart.of(contact_m, force_n, self.contact_m, self.force_n)
        columns = [apart.covariance(self.length_m[m], self.variance[m]) @ self.weight[:, m] for m in range(len(MODES))]
        return np.stack(columns, axis=1)

    def unseen(self, table: ResponseTable, seen: Array) -> Array:
        """(N,D) what real presses showed, ``seen`` (N,D), moved so that they differ from the corrected ``table`` as
        they would had their own places not corrected it."""
        basis = modes(table, self.contact_m, self.force_n)
        return seen + np.einsum("nm,nmd->nd", self.at(self.contact_m, self.force_n) - self.left_out, basis)

    def correct(self, table: ResponseTable) -> ResponseTable:
        """The table with the discrepancy added at every place and force."""
        table = table.with_forces(FINER_FORCES)
        contact_m, force_n = table.grid.presses()
        added = np.empty((len(force_n), table.response.shape[3]))
        for rows in np.array_split(np.arange(len(force_n)), max(1, len(force_n) // 500)):
            basis = modes(table, contact_m[rows, 0], force_n[rows, 0])
            added[rows] = np.einsum("nm,nmd->nd", self.at(contact_m[rows, 0], force_n[rows, 0]), basis)
        return table.corrected(added)


def modes(table: ResponseTable, contact_m: Array, force_n: Array) -> Array:
    """(N,6,D) changes of the response by one unit of each of the ``MODES``.

    Each is what of its slope lies across those before (Gram-Schmidt): a wider response is a stronger one too, and
    numbers found along directions so nearly parallel err together, which processes of each by itself do not know.
    """
    chosen = slopes(table, contact_m, force_n)
    square: list[Array] = []
    for k in range(1, len(MODES)):
        square.append(np.maximum((chosen[:, k - 1] ** 2).sum(axis=1), np.finfo(float).tiny))
        for before in range(k):
            along = np.einsum("nd,nd->n", chosen[:, k], chosen[:, before])
            chosen[:, k] -= (along / square[before])[:, None] * chosen[:, before]
    return np.asarray(chosen)


def slopes(table: ResponseTable, contact_m: Array, force_n: Array) -> Array:
    """(N,6,D) by the logarithm of the force, by x and y in 5 mm, and second ones by xx, yy and xy."""
    rows = table.tangents(contact_m, force_n)
    scale = np.array([1.0, SHAPE_M, SHAPE_M, SHAPE_M**2, SHAPE_M**2, SHAPE_M**2])
    chosen = rows[:, [3, 1, 2, 4, 5, 6]] * scale[:, None]
    chosen[:, 0] *= force_n[:, None]
    return np.asarray(chosen)


def coefficients(basis: Array, residual: Array) -> tuple[Array, Array]:
    """(N,6) most likely numbers of each press by itself, and the variance (N,6) they are known with."""
    precision = np.einsum("nmd,nkd->nmk", basis, basis) + np.eye(len(MODES)) / EXPECTED**2
    covariance = np.linalg.inv(precision)
    numbers = np.einsum("nmk,nkd,nd->nm", covariance, basis, residual)
    return numbers, np.diagonal(covariance, axis1=1, axis2=2)


def frame_scatter(force_n: Array, press: NDArray[np.int64], numbers: Array, noise: Array) -> Array:
    """(6,) variances by which frames of one press differ from a curve over their forces (N,), beyond what their numbers
    (N,6) are known with, ``noise`` (N,6): the load cell's noise, what a fabric remembers.

    A process that is smooth over the force has no other way to explain it than a variance far too large.
    """
    square, freedom = np.zeros(len(MODES)), 0
    for number in np.unique(press):
        rows = np.flatnonzero(press == number)
        if len(rows) > BEND + 1:
            curve = np.vander(np.log(force_n[rows]), BEND + 1)
            left = numbers[rows] - curve @ np.linalg.lstsq(curve, numbers[rows], rcond=None)[0]
            square += (left**2).sum(axis=0)
            freedom += len(rows) - BEND - 1
    return np.maximum(square / max(freedom, 1) - noise.mean(axis=0), 0.0)


class Apart(NamedTuple):
    """Squared distances (N,M) in metre squared, and the forces' part (N,M) of a process's covariance."""

    square_m2: Array
    forces: Array

    @classmethod
    def of(cls, a_m: Array, a_n: Array, b_m: Array, b_n: Array) -> Apart:
        """Between places (N,2) with (N,) newton and (M,2) with (M,)."""
        forces = np.exp(-0.5 * ((np.log(a_n)[:, None] - np.log(b_n)) / FORCE_LENGTH) ** 2)
        return cls(((a_m[:, None] - b_m) ** 2).sum(axis=2), 0.5 + 0.5 * forces)

    def covariance(self, length_m: float, variance: float) -> Array:
        """(N,M) of one of the numbers here and there."""
        near = COMMON + (1.0 - COMMON) * np.exp(-0.5 * self.square_m2 / length_m**2)
        return variance * near * self.forces


def evidences(
    contact_m: Array, force_n: Array, press: NDArray[np.int64], number: Array, noise: Array
) -> list[tuple[float, Process]]:
    """Log likelihood of (N,) numbers known with variance ``noise`` (N,) under each process."""
    found = []
    same = press[:, None] == press
    apart = Apart.of(contact_m, force_n, contact_m, force_n)
    scatters = SCATTERS if len(np.unique(contact_m, axis=0)) >= ENOUGH else (0.0,)
    for length in LENGTHS_M:
        for variance in VARIANCES:
            kernel = apart.covariance(length, variance) + np.diag(noise)
            for scatter in scatters:
                factor = cho_factor(kernel + scatter * same)
                evidence = -0.5 * number @ cho_solve(factor, number) - np.log(np.diag(factor[0])).sum()
                found.append((float(evidence), Process(length, variance, scatter)))
    return found


def _process(
    contact_m: Array,
    force_n: Array,
    press: NDArray[np.int64],
    number: Array,
    noise: Array,
    groups: list[NDArray[np.intp]],
) -> tuple[float, float, float, Array, Array]:
    """The process of the largest likelihood, weights (N,), and each press's number (N,) without its place."""
    _, best = max(evidences(contact_m, force_n, press, number, noise))
    kernel = Apart.of(contact_m, force_n, contact_m, force_n).covariance(best.length_m, best.variance)
    inverse = np.linalg.inv(kernel + best.scatter * (press[:, None] == press) + np.diag(noise))
    weight = inverse @ number
    without = number.copy()
    for rows in groups:
        # What the others say of a block, from the inverse alone (Rasmussen & Williams 2006, 5.4.2).
        without[rows] -= np.linalg.solve(inverse[np.ix_(rows, rows)], weight[rows])
    return *best, weight, without


def _model_error(
    basis: Array,
    residual: Array,
    numbers: Array,
    noise: Array,
    left_out: Array,
    places: int,
    table: ResponseTable,
    contact_m: Array,
    force_n: Array,
) -> ModelError:
    """What places that weren't pressed will err by, from what each place would have erred by had it not been."""
    assumed = np.full(len(MODES), EXPECTED)
    wrong = assumed if places < FEWEST else np.sqrt(np.mean((numbers - left_out) ** 2, axis=0))
    left = residual - np.einsum("nm,nmd->nd", numbers, basis)
    response2 = (table.alone(contact_m, force_n) ** 2).sum(axis=1)
    share = np.maximum((left**2).sum(axis=1) - left.shape[1], 0.0) / response2
    _, x, y, *shape = wrong
    size = EXPECTED
    if places >= FEWEST:
        grown2 = (numbers - left_out)[:, 0] ** 2 * (basis[:, 0] ** 2).sum(axis=1)
        size = float(np.sqrt(np.mean(grown2 / response2)))
    return ModelError(np.array(shape), float(np.sqrt(np.median(share))), np.array([SHAPE_M * x, SHAPE_M * y, size]))
