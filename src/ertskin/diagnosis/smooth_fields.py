"""A property that varies smoothly over the sheet: a Gaussian process in a spot's stead, where it predicts better."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.candidates import added_gain
from ertskin.diagnosis.voltage_fit import Solved, Term, VoltageProblem
from physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from physics.effects.sheet_inhomogeneity import SheetInhomogeneity
from physics.effects.smooth_field import node_position_m

Array = NDArray[np.float64]

SHAPE = (7, 7)
LENGTHS = (0.22, 0.4)
"""Correlation lengths tried, over the sheet's longer side."""
SPREADS = (0.03, 0.1, 0.3, 1.0)
"""Standard deviations of the field tried."""
LEAST = 3e-3
"""Modes are left out from this part of the first one's variance on."""
PASSES = 2
SIGNIFICANT = 15.0


@dataclass(frozen=True, eq=False)
class Modes:
    """``values`` (K, nodes): fields whose random sums, each of unit variance, are the process of unit variance."""

    values: Array

    @classmethod
    def of(cls, extent_m: Array, length: float) -> Modes:
        """Squared-exponential covariance between the nodes, its eigenvectors scaled by their standard deviations."""
        node = node_position_m(SHAPE, extent_m)
        apart = ((node[:, None] - node) ** 2).sum(axis=-1) / (length * float(np.ptp(extent_m, axis=0).max())) ** 2
        variance, vector = np.linalg.eigh(np.exp(-0.5 * apart))
        kept = variance > LEAST * variance.max()
        return cls((vector[:, kept] * np.sqrt(variance[kept])).T[::-1])


def with_smooth_fields(problem: VoltageProblem, current: Solved, partitions: Sequence[Sequence[int]]) -> Solved:
    """The fit with a smooth field in each inhomogeneity, where it predicts cells held out significantly better."""
    for number, term in enumerate(current.terms):
        if isinstance(term.effect, PiezoInhomogeneity | SheetInhomogeneity) and term.free:
            for _ in range(PASSES):
                freed = _freed(problem, current, number, partitions)
                if freed is None or freed.cost > current.cost:
                    break
                current = freed
    return current


def _freed(problem: VoltageProblem, current: Solved, number: int, partitions: Sequence[Sequence[int]]) -> Solved | None:
    """One Gauss-Newton step in the field, its length and spread those that predict best; then the rest again.

    None where no field predicts cells held out significantly better.
    """
    effect = current.terms[number].effect
    assert isinstance(effect, PiezoInhomogeneity | SheetInhomogeneity)
    current = problem.at_hand(current)
    known = np.asarray(effect.nodes) if effect.nodes else np.zeros(SHAPE)
    best, field = SIGNIFICANT, None
    for length in LENGTHS:
        modes = Modes.of(problem.evidence.sensor.extent_m, length)
        columns, specimen = _columns(problem, current, number, effect, known, modes)
        for spread in SPREADS:
            prior = np.full(len(modes.values), spread**-2)
            base = current.scan_residual
            gain, value = added_gain(
                problem, current, columns, base, specimen, np.zeros((len(specimen), len(prior))), partitions, prior
            )
            if gain > best and np.isfinite(value).all():
                best, field = gain, value @ modes.values
    if field is None:
        return None
    nodes = tuple(tuple(map(float, row)) for row in known + field.reshape(SHAPE))
    terms = list(current.terms)
    terms[number] = Term(replace(effect, nodes=nodes), terms[number].free)
    return problem.solve(terms, current.calibration, steps=5)


def _columns(
    problem: VoltageProblem,
    current: Solved,
    number: int,
    effect: PiezoInhomogeneity | SheetInhomogeneity,
    known: Array,
    modes: Modes,
) -> tuple[Array, Array]:
    """(T,P,K) change of the whitened residual by each mode, and the specimen's residual (N,), which has no places."""
    size = 0.02
    base = problem.scan_residual(problem.family.skin(current.calibration, current.effects))
    columns = np.empty((*base.shape, len(modes.values)))
    for k, mode in enumerate(modes.values):
        nodes = tuple(tuple(map(float, row)) for row in known + size * mode.reshape(SHAPE))
        effects = [*current.effects[:number], replace(effect, nodes=nodes), *current.effects[number + 1 :]]
        moved = problem.scan_residual(problem.family.skin(current.calibration, effects))
        columns[..., k] = (base - moved) / size
    if problem.specimen is None:
        return columns, np.zeros(0)
    return columns, problem.specimen.residual(problem.family.skin(current.calibration, current.effects))
