"""A property that varies smoothly over the sheet: a Gaussian process in a spot's stead, where it predicts better."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.joint_fit import Solved, Term, VoltageProblem
from ertskin.diagnosis.search.first_order_gain import added_gain
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.smooth_field import Nodes, node_position_m

Array = NDArray[np.float64]

SHAPE = (7, 7)
LENGTHS = (0.22, 0.4)
"""Correlation lengths tried, over the sheet's longer side."""
SPREADS = (0.03, 0.1, 0.3, 1.0)
"""Standard deviations of the field tried."""
LEAST = 3e-3
"""Modes are left out from this part of the first one's variance on."""
PASSES = 2
PROBE = 0.02
"""Size of a mode at which its derivative is taken."""
SIGNIFICANT = 15.0
SHARES = 1.0, 0.3, 0.1
"""Of a step to first order, of which the first that lowers the misfit is taken."""


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
        for _ in range(PASSES if term.effect.hypothesis.field and term.free else 0):
            freed = _freed(problem, current, number, partitions)
            if freed is None:
                break
            current = freed
    return current


def _freed(problem: VoltageProblem, current: Solved, number: int, partitions: Sequence[Sequence[int]]) -> Solved | None:
    """One Gauss-Newton step in the field, then the rest again; None where none gains, held out, what matters."""
    effect = current.terms[number].effect
    current = problem.at_hand(current)
    others = (*current.effects[:number], *current.effects[number + 1 :])
    gain, nodes = best_field(problem, current, others, effect, partitions, LENGTHS)
    if nodes is None or gain < SIGNIFICANT:
        return None
    known = _nodes(effect)
    for share in SHARES:
        terms = list(current.terms)
        # What multiplies is far from linear: a whole step may overshoot.
        stepped = _plain(known + share * (np.asarray(nodes) - known))
        terms[number] = Term(effect.changed({"nodes": stepped}), terms[number].free)
        freed = problem.solve(terms, current.calibration, steps=5)
        if freed.cost <= current.cost:
            return freed
    return None


def best_field(
    problem: VoltageProblem,
    current: Solved,
    others: tuple[Effect, ...],
    effect: Effect,
    partitions: Sequence[Sequence[int]],
    lengths: Sequence[float],
) -> tuple[float, Nodes | None]:
    """Held-out gain, to first order, of the field that predicts best, and its nodes (None: none gains anything).

    ``effect`` as it is in the fit at hand, or neutral; ``others`` the fit's other effects.
    """
    known = _nodes(effect)
    best, field = 0.0, None
    here = problem.family.skin(current.calibration, (*others, effect))
    base = problem.scan_residual(here)
    specimen = np.zeros(0) if problem.specimen is None else problem.specimen.residual(here)
    for length in lengths:
        modes = Modes.of(problem.evidence.sensor.extent_m, length)
        columns = np.empty((*base.shape, len(modes.values)))
        for k, mode in enumerate(modes.values):
            probe = effect.changed({"nodes": _plain(known + PROBE * mode.reshape(SHAPE))})
            moved = problem.scan_residual(problem.family.skin(current.calibration, (*others, probe)))
            columns[..., k] = (base - moved) / PROBE
        nowhere = np.zeros((len(specimen), len(modes.values)))
        for spread in SPREADS:
            precision = np.full(len(modes.values), spread**-2)
            gain, value = added_gain(problem, current, columns, base, specimen, nowhere, partitions, precision)
            if gain > best and np.isfinite(value).all():
                best, field = gain, value @ modes.values
    return best, None if field is None else _plain(known + field.reshape(SHAPE))


def _nodes(effect: Effect) -> Array:
    """Node values of an effect's field, noughts where it has none."""
    nodes: Nodes = getattr(effect, "nodes", ())
    return np.asarray(nodes) if nodes else np.zeros(SHAPE)


def _plain(nodes: Array) -> Nodes:
    return tuple(tuple(map(float, row)) for row in nodes)
