"""The library of effects as a dictionary: what every start of every effect would change, to first order about a fit.

Two signals, independent of each other: the scans with the specimen, and what no resistor network explains of the
readings, which shows the instrument's effects. A property that varies over the sheet stands in it as its spots, lines,
steps and slopes; a smooth field, of as many numbers as there are nodes, would resemble anything.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.candidates import displacement_columns
from ertskin.diagnosis.search.smooth_fields import at_nodes, node_shape
from ertskin.physics.effects.effect import AcquisitionEffect, Effect, ElectrodeEffect, Start, shown_by
from ertskin.physics.effects.hypothesis import Measured, Signal
from ertskin.physics.effects.registry import effects_shown_by, measured_as
from ertskin.physics.effects.smooth_field import field_design

Array = NDArray[np.float64]

LEAST_UNEXPLAINED = 1e-6
"""Part of a column's square from which on what the calibration doesn't explain of it counts."""
LARGEST = 5.0
"""Times what is typical of a parameter: the largest amount of an effect that a fit begins with."""
SHARES = 0.05, 5.0
"""Least and most of a whole effect that a fit begins with."""
FRAMES = 4
"""Frames whose readings are distorted at a time."""


@dataclass(frozen=True, eq=False)
class Atom:
    """A start of an effect, by its columns as sums of the dictionary's, ``onto`` (B,c). ``positive``: there can't be
    less than none of it."""

    start: Start
    onto: Array
    positive: bool = False

    @property
    def effect(self) -> Effect:
        return self.start.effect

    @property
    def instrument(self) -> bool:
        """Whether what no network explains shows it."""
        return shown_by(self.effect, Signal.NONRECIPROCAL)

    def term(self, amount: Array) -> Term:
        """The term that begins with these amounts (c,) of its columns."""
        effect, free, known = self.effect, self.start.free, self.effect.parameters()
        if not self.start.along:
            return Term(effect, free).nearer(float(np.clip(amount[0], *SHARES)))
        values = {}
        for key, size in zip(self.start.along, map(float, amount), strict=True):
            about = known[key]
            most = LARGEST * about.typical
            near = np.clip(size, about.neutral - most, about.neutral + most)
            values[key] = float(np.clip(near, 0.9 * about.low, 0.9 * about.high))
        return Term(effect.changed(values), free)


@dataclass(frozen=True, eq=False)
class Dictionary:
    """What atoms would change of one signal, in B columns in units of the noise: their ``gram`` matrix (B,B); reduced
    gradient (B,) and Gram matrix, the fit's own numbers at their best for each. It stands for ``share`` such signals.
    """

    atoms: tuple[Atom, ...]
    gram: Array
    reduced_gradient: Array
    reduced_gram: Array
    share: float = 1.0

    def falls(self, gradient: Array) -> tuple[Array, NDArray[np.intp]]:
        """(D,A) chi-square that each atom takes off with the fit's own numbers free, for reduced gradients (D,B), and
        how many numbers (A,) it takes."""
        falls, ranks = np.zeros((len(gradient), len(self.atoms))), np.zeros(len(self.atoms), dtype=np.intp)
        for k, atom in enumerate(self.atoms):
            along = gradient @ atom.onto
            inverse, ranks[k] = self._inverse(atom.onto)
            falls[:, k] = np.einsum("dc,ce,de->d", along, inverse, along)
            if atom.positive:
                falls[along[:, 0] <= 0, k] = 0.0
        return falls, ranks

    def amount(self, number: int) -> Array:
        """(c,) the best amounts of an atom's columns, the fit's own numbers free."""
        onto = self.atoms[number].onto
        return np.asarray(self._inverse(onto)[0] @ onto.T @ self.reduced_gradient)

    def _inverse(self, onto: Array) -> tuple[Array, int]:
        """The inverse of columns' reduced Gram matrix in the directions the fit leaves, and how many they are."""
        scale = np.sqrt(np.maximum(np.einsum("bc,bd,dc->c", onto, self.gram, onto), 1e-300))
        size, vector = np.linalg.eigh(onto.T @ self.reduced_gram @ onto / scale[:, None] / scale)
        kept = vector[:, size > LEAST_UNEXPLAINED] / scale[:, None]
        return np.asarray((kept / size[size > LEAST_UNEXPLAINED]) @ kept.T), kept.shape[1]


def dictionaries(problem: VoltageProblem, solved: Solved) -> list[Dictionary]:
    """Those of both signals about a fit, without what is in it; that of the instrument where readings tell of it."""
    current = problem.at_hand(solved)
    protocol = problem.evidence.protocol
    found = [_of_scans(problem, current)]
    if protocol.count > protocol.orthonormal.shape[1]:
        found.append(_of_leftover(problem, current))
    return [one for one in found if one.atoms]


# scans --------------------------------------------------------------------------------------------------------------


def _of_scans(problem: VoltageProblem, solved: Solved) -> Dictionary:
    start_columns, kinds = [*_through_scans(problem, solved), *_pads(problem, solved)], _absent_fields(solved)
    gradient, gram = _normal_equations(problem, solved, start_columns, kinds)
    own, count = solved.fit, len(solved.fit.value)
    pull = gradient[:count] - own.prior.diagonal() * own.from_prior
    cross, added = gram[count:, :count], slice(count, None)
    by_own = cross @ np.linalg.pinv(gram[:count, :count] + own.prior, rcond=1e-12, hermitian=True)
    atoms = _atoms(problem, start_columns, kinds, len(gradient) - count)
    reduced = gradient[added] - by_own @ pull, gram[added, added] - by_own @ cross.T
    return Dictionary(atoms, gram[added, added], *reduced)


def _atoms(
    problem: VoltageProblem, start_columns: Sequence[_StartColumns], kinds: Sequence[type[Effect]], total: int
) -> tuple[Atom, ...]:
    """The atoms by ``total`` columns: of starts with columns of their own, then of each kind of field at the nodes."""
    firsts = np.cumsum([0, *(one.scan.shape[1] for one in start_columns)]).tolist()
    ends = pairwise(firsts)
    atoms = [
        Atom(one.start, np.eye(total)[:, slice(*end)], one.positive)
        for one, end in zip(start_columns, ends, strict=True)
    ]
    sensor, nodes = problem.evidence.sensor, int(np.prod(node_shape(problem.evidence.sensor.extent_m)))
    for k, kind in enumerate(kinds):
        of_kind = slice(firsts[-1] + k * nodes, firsts[-1] + (k + 1) * nodes)
        for start in kind.reading_starts(sensor, problem.evidence.protocol):
            onto = np.zeros((total, len(start.along)))
            onto[of_kind] = at_nodes(start, sensor.extent_m)
            atoms.append(Atom(start, onto))
    return tuple(atoms)


@dataclass(frozen=True, eq=False)
class _StartColumns:
    """A start with its columns of the scans (N,c) and of the specimen (S,c)."""

    start: Start
    scan: Array
    specimen: Array
    positive: bool = False


def _through_scans(problem: VoltageProblem, solved: Solved) -> Iterator[_StartColumns]:
    """Effects that act on the skin as a whole, by the scans with and without them."""
    base = _residuals(problem, solved.effects, solved)
    present = {term.name for term in solved.terms}
    for kind in effects_shown_by(Signal.READINGS):
        displaces = issubclass(kind, ElectrodeEffect) and kind.displaces()
        if kind.name in present or kind.hypothesis.field or displaces:
            continue
        known = kind.parameters()
        for start in kind.reading_starts(problem.evidence.sensor, problem.evidence.protocol):
            if shown_by(kind, Signal.NONRECIPROCAL) and not start.reciprocal:
                continue
            probes = [(start.effect.changed({key: known[key].typical}), known[key].typical) for key in start.along]
            columns = []
            for probe, size in probes or [(start.effect, 1.0)]:
                probed = _residuals(problem, (*solved.effects, probe), solved)
                columns.append([(before - moved) / size for before, moved in zip(base, probed, strict=True)])
            scan, specimen = (np.stack(part, axis=-1) for part in zip(*columns, strict=True))
            yield _StartColumns(start, scan, specimen, _positive(start))


def _residuals(problem: VoltageProblem, effects: Sequence[Effect], solved: Solved) -> tuple[Array, Array]:
    """(N,) of the scans and (S,) of the specimen, in units of the noise."""
    skin = problem.family.skin(solved.calibration, tuple(effects))
    specimen = problem.specimen.residual(skin) if problem.specimen is not None else np.zeros(0)
    return problem.scan_residual(skin).ravel(), specimen


def _positive(start: Start) -> bool:
    known = start.effect.parameters()
    return not start.along or (len(start.along) == 1 and known[start.along[0]].low >= known[start.along[0]].neutral)


def _pads(problem: VoltageProblem, solved: Solved) -> Iterator[_StartColumns]:
    """Displaced electrodes, from the shape derivatives that the linearised skin holds."""
    kind = measured_as(Measured.PAD_SHIFT)
    present = {(term.name, _number(term.effect)) for term in solved.terms}
    stresses = 0 if problem.specimen is None else len(problem.specimen.stress_pa)
    for start in kind.reading_starts(problem.evidence.sensor, problem.evidence.protocol):
        if (kind.name, _number(start.effect)) in present:
            continue
        columns = displacement_columns(problem, start)
        count = columns.shape[-1]
        yield _StartColumns(start, columns.reshape(-1, count), np.zeros((stresses, count)))


def _number(effect: Effect) -> int:
    """The electrode or channel that an effect belongs to, -1 for none."""
    return int(getattr(effect, "electrode", getattr(effect, "channel", -1)))


def _absent_fields(solved: Solved) -> list[type[Effect]]:
    present = {term.name for term in solved.terms}
    return [k for k in effects_shown_by(Signal.READINGS) if k.hypothesis.field and k.name not in present]


def _normal_equations(
    problem: VoltageProblem, solved: Solved, start_columns: Sequence[_StartColumns], kinds: Sequence[type[Effect]]
) -> tuple[Array, Array]:
    """Gradient and Gram matrix of the fit's own columns, the starts', and those of fields at the nodes."""
    known, known_specimen = problem.last_columns
    times, width = solved.scan_residual.shape
    whole = np.concatenate(
        [known.reshape(times * width, -1), *(one.scan for one in start_columns)], axis=1, dtype=np.float32
    )
    whole = whole.reshape(times, width, -1)
    specimen = np.concatenate([known_specimen, *(one.specimen for one in start_columns)], axis=1)
    count = whole.shape[-1]
    nodes = int(np.prod(node_shape(problem.evidence.sensor.extent_m)))
    total = count + nodes * len(kinds)
    gradient, gram = np.zeros(total), np.zeros((total, total))
    wrong = _residuals(problem, solved.effects, solved)[1]
    gradient[:count], gram[:count, :count] = specimen.T @ wrong, specimen.T @ specimen
    for rows, columns in _by_nodes(problem, solved, kinds):
        flat = np.concatenate([whole[rows], columns], axis=-1).reshape(-1, total).astype(float)
        gradient += flat.T @ solved.scan_residual[rows].ravel()
        gram += flat.T @ flat
    return gradient, gram


def _by_nodes(
    problem: VoltageProblem, solved: Solved, kinds: Sequence[type[Effect]]
) -> Iterator[tuple[NDArray[np.intp], Array]]:
    """Rows (m,), patch by patch, and what fields of these kinds change of them at each node, (m,P,K)."""
    if not kinds:
        times, width = solved.scan_residual.shape
        yield np.arange(times), np.zeros((times, width, 0))
        return
    extent_m = problem.evidence.sensor.extent_m
    fields = partial(field_design, node_shape(extent_m), extent_m=extent_m)
    skins = [problem.family.skin(solved.calibration, (*solved.effects, kind())) for kind in kinds]
    every = [problem.field_columns(skin, len(solved.effects), fields) for skin in skins]
    for parts in zip(*every, strict=True):
        yield parts[0][0], np.concatenate([columns for _, columns in parts], axis=-1)


# what no network explains -------------------------------------------------------------------------------------------


def _of_leftover(problem: VoltageProblem, solved: Solved) -> Dictionary:
    """No number of the calibration changes what no network explains: the fit's own have no part in it."""
    wrong = problem.acquisition.residual(problem.family.skin(solved.calibration, solved.effects))
    starts = _instrument_starts(problem, solved)
    changes = [_change(problem, solved, start) for start in starts]
    gradient, gram = np.zeros(len(starts)), np.zeros((len(starts), len(starts)))
    for first in range(0, len(wrong), FRAMES):
        rows = slice(first, first + FRAMES)
        # Readings left out are noughts in the residual, too.
        read = (wrong[rows] != 0).ravel()
        columns = np.stack([np.where(read, change(rows).ravel(), 0.0) for change in changes], axis=-1)
        gradient += columns.T @ wrong[rows].ravel()
        gram += columns.T @ columns
    atoms = tuple(Atom(s, np.eye(len(starts))[:, k : k + 1], _positive(s)) for k, s in enumerate(starts))
    return Dictionary(atoms, gram, gradient, gram, problem.leftover_share)


def _change(problem: VoltageProblem, solved: Solved, start: Start) -> Callable[[slice], Array]:
    """What a start changes, per unit of its parameter, of what no network explains of some of the signal's rows."""
    signal, effect, evidence = problem.acquisition, start.effect, problem.evidence
    unit = evidence.leftover_noise_v * float(getattr(effect, start.along[0]))
    skin = problem.family.skin(solved.calibration, solved.effects)
    if isinstance(effect, AcquisitionEffect):
        scans, basis = signal.scans(skin)[signal.rows], evidence.protocol.orthonormal
        shape = (-1, *evidence.protocol.shape)
        return lambda rows: signal.beyond_networks(effect, (scans[rows] @ basis.T).reshape(shape)) / unit
    moved = signal.leftover(problem.family.skin(solved.calibration, (*solved.effects, effect))) - signal.leftover(skin)
    return lambda rows: moved[rows] / unit


def _instrument_starts(problem: VoltageProblem, solved: Solved) -> list[Start]:
    """Where effects that what no network explains shows begin, each along one parameter."""
    present = {(term.name, _number(term.effect)) for term in solved.terms}
    found = []
    for kind in effects_shown_by(Signal.NONRECIPROCAL):
        if kind.hypothesis.measured == Measured.READING_LIMIT and problem.evidence.saturated_v is not None:
            # It is known, and the readings that show it are left out.
            continue
        for start in kind.reading_starts(problem.evidence.sensor, problem.evidence.protocol):
            effect = start.effect
            if start.reciprocal or (kind.name, _number(effect)) in present:
                continue
            if isinstance(effect, AcquisitionEffect):
                effect = effect.scaled_to(problem.acquisition.largest_v)
            found.append(replace(start, effect=effect))
    return found
