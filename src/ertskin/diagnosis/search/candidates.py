"""What could be missing: for every effect the terms a fit starts from, screened by their gain to first order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.nonreciprocal import readings_met
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.first_order_gain import (
    Moved,
    add_leftover,
    added_gain,
    beyond_networks,
    held_out_gain,
    with_columns,
)
from ertskin.diagnosis.search.forms import beginnings
from ertskin.diagnosis.search.smooth_fields import NodeQuadratic, at_nodes, predictive
from ertskin.physics.effects.effect import AcquisitionEffect, Effect, ElectrodeEffect, Parameter, Start, shown_by
from ertskin.physics.effects.hypothesis import Measured, Signal
from ertskin.physics.effects.registry import effects_shown_by, measured_as
from ertskin.physics.sensor import Sensor
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]

LEAST_LEFTOVER = 0.05
"""Least part of an instrument's pattern expected to lie outside what a network could give."""
SHARES = 0.05, 20.0
"""Least and most of a whole effect that a screening may ask for."""
FARTHEST_M = 5e-3
"""How far from its place a pad is begun at most."""


@dataclass(frozen=True)
class Candidate:
    """A term to try, where it starts, and what screening expects it to gain (half chi-square, held out); ``beyond``
    that of what no network explains alone. ``others``: the same begun otherwise."""

    term: Term
    gain: float
    beyond: float = 0.0
    others: tuple[Term, ...] = ()

    @property
    def name(self) -> str:
        return self.term.name


def screen(problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]]) -> list[Candidate]:
    """Every term that isn't in the fit yet, best first."""
    found = [*_through_scans(problem, solved, partitions), *_electrodes(problem, solved, partitions)]
    found += _fields(problem, solved, partitions)
    found += _instrument(problem, solved, partitions)
    return sorted(found, key=lambda c: -c.gain)


def _through_scans(problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]]) -> list[Candidate]:
    fitted_skin = problem.family.skin(solved.calibration, solved.effects)
    present = {t.name for t in solved.terms}
    base = problem.scan_residual(fitted_skin)
    specimen = problem.specimen.residual(fitted_skin) if problem.specimen is not None else np.zeros(0)
    found = []
    kinds = [kind for kind in effects_shown_by(Signal.READINGS) if kind.name not in present and not _moves_pads(kind)]
    for start in _starts(problem, kinds):
        probes, finish = _trial(start)
        probed = _probed(problem, solved, probes)
        columns = _columns(problem.scan_residual, base, probed)
        extra = np.zeros((0, len(probes)))
        if problem.specimen is not None:
            extra = _columns(problem.specimen.residual, specimen, probed)
        gain, value = added_gain(problem, solved, columns, base, specimen, extra, partitions)
        if np.isfinite(gain) and np.isfinite(value).all():
            found.append(Candidate(finish(value), gain))
    return found


Probes = list[tuple[Effect, float]]


def _probed(problem: VoltageProblem, solved: Solved, probes: Probes) -> list[tuple[Skin, float]]:
    """The fit's skin with each probe beside its effects, and the probe's size."""
    return [(problem.family.skin(solved.calibration, (*solved.effects, probe)), size) for probe, size in probes]


def _columns(residual: Callable[[Skin], Array], base: Array, probed: Sequence[tuple[Skin, float]]) -> Array:
    """(...,c) what probes change of a residual, ``base`` (...) without them."""
    return np.stack([(base - residual(skin)) / size for skin, size in probed], axis=-1)


def _starts(problem: VoltageProblem, kinds: Sequence[type[Effect]]) -> list[Start]:
    """Starts of few numbers that the scans show."""
    return [
        start
        for kind in kinds
        if not kind.hypothesis.field
        for start in kind.reading_starts(problem.evidence.sensor, problem.evidence.protocol)
        if start.reciprocal or not shown_by(kind, Signal.NONRECIPROCAL)
    ]


def _moves_pads(kind: type[Effect]) -> bool:
    return issubclass(kind, ElectrodeEffect) and kind.displaces()


def _trial(start: Start) -> tuple[Probes, Callable[[Array], Term]]:
    """Probes whose columns go into the screening together, and the term their best values start."""
    known = start.effect.parameters()
    if not start.along:
        # It can't be negative: the probe is the whole effect, its value the share of it.
        return [(start.effect, 1.0)], lambda value: Term(start.effect, start.free).nearer(_share(value[0]))
    probes: Probes = [(start.effect.changed({key: known[key].typical}), known[key].typical) for key in start.along]

    def finish(value: Array) -> Term:
        limited = {key: _inside(float(v), known[key]) for key, v in zip(start.along, value, strict=True)}
        return Term(start.effect.changed(limited), start.free)

    return probes, finish


def _share(value: float) -> float:
    return float(np.clip(value, *SHARES))


def _inside(value: float, known: Parameter) -> float:
    return float(np.clip(value, known.low * 0.9, known.high * 0.9))


def _fields(problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]]) -> list[Candidate]:
    """Properties that vary over the sheet: as a smooth field, and in every form of few numbers the best."""
    present = {t.name for t in solved.terms}
    extent_m = problem.evidence.sensor.extent_m
    found = []
    for kind in effects_shown_by(Signal.READINGS):
        if kind.hypothesis.field and kind.name not in present:
            effects = (*solved.effects, kind())
            quadratic = NodeQuadratic.of(problem, solved, effects, len(effects) - 1)
            process = predictive(quadratic, extent_m, partitions)
            if process.gain > 0 and np.isfinite(process.sizes).all():
                term, *others = process.of(Term(kind(), ()), extent_m)
                found.append(Candidate(term, process.gain, others=tuple(others)))
            found += _forms(problem, quadratic, kind, partitions)
    return found


def _forms(
    problem: VoltageProblem, quadratic: NodeQuadratic, kind: type[Effect], partitions: Sequence[Sequence[int]]
) -> list[Candidate]:
    """Of the starts that free the same numbers of a field the likeliest, by what they are at the field's nodes."""
    sensor, protocol = problem.evidence.sensor, problem.evidence.protocol
    starts = kind.reading_starts(sensor, protocol)
    gradient, hessian = quadratic.reduced()
    found = []
    for free in dict.fromkeys(start.free for start in starts):
        alike = [start for start in starts if start.free == free]
        shapes = [at_nodes(start, sensor.extent_m) for start in alike]
        gains = [_gain_along(shape, gradient, hessian) for shape in shapes]
        best = int(np.argmax(gains))
        gain, value = quadratic.along(shapes[best], 0.0, partitions)
        if np.isfinite(gain) and np.isfinite(value).all():
            term, *others = beginnings(_trial(alike[best])[1](value))
            found.append(Candidate(term, gain, others=tuple(others)))
    return found


def _gain_along(shape: Array, gradient: Array, hessian: Array) -> float:
    """Half chi-square that fields (M,c) gain where they are fitted."""
    pull, curved = shape.T @ gradient, shape.T @ hessian @ shape
    return 0.5 * float(pull @ np.linalg.lstsq(curved, pull, rcond=1e-10)[0])


def _electrodes(problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]]) -> list[Candidate]:
    """Displaced electrodes, from the shape derivatives the states hold."""
    base = solved.scan_residual
    specimen = np.zeros(0)
    found = []
    for start in _pads(problem, solved):
        columns = displacement_columns(problem, start)
        extra = np.zeros((0, len(start.along)))
        gain, value = added_gain(problem, solved, columns, base, specimen, extra, partitions)
        if np.isfinite(gain) and np.isfinite(value).all():
            found.append(Candidate(_displaced(start, value), gain))
    return found


def _pads(problem: VoltageProblem, solved: Solved) -> list[Start]:
    """Starts of the pads out of place that the fit doesn't hold yet."""
    pads = measured_as(Measured.PAD_SHIFT)
    present = {number_of(t.effect) for t in solved.terms if t.name == pads.name}
    starts = pads.reading_starts(problem.evidence.sensor, problem.evidence.protocol)
    return [start for start in starts if number_of(start.effect) not in present]


def _displaced(start: Start, shift_m: Array) -> Term:
    shift = np.clip(shift_m, -FARTHEST_M, FARTHEST_M)
    return Term(start.effect.changed(dict(zip(start.along, shift.tolist(), strict=True))), start.free)


@dataclass(frozen=True, eq=False)
class Direction:
    """What a start's numbers change of the scans to first order, ``columns`` (T,P,c) in units of the noise, and the
    term ``begun`` at values (c,) of them; ``positive``: the number is a share of the start, none below nought."""

    columns: Array
    begun: Callable[[Array], Term]
    positive: bool = False


def like_a_field(problem: VoltageProblem, solved: Solved, field: Term) -> Iterator[Direction]:
    """Terms of few numbers, not in the fit yet, that depend on what the ``field`` depends on, a place or a time."""
    kin, present = field.effect.hypothesis.kin, {t.name for t in solved.terms}
    alike = [kind for kind in effects_shown_by(Signal.READINGS) if kind.hypothesis.kin & kin]
    if any(map(_moves_pads, alike)):
        for start in _pads(problem, solved):
            yield Direction(displacement_columns(problem, start), partial(_displaced, start))
    others = [kind for kind in alike if kind.name not in present and not _moves_pads(kind)]
    for start in _starts(problem, others):
        probes, finish = _trial(start)
        columns = _columns(problem.scan_residual, solved.scan_residual, _probed(problem, solved, probes))
        yield Direction(columns, finish, positive=not start.along)


def displacement_columns(problem: VoltageProblem, start: Start) -> Array:
    """(T,P,n) change of the scans per metre along what a displaced electrode is screened for, in units of the noise."""
    sensor = problem.evidence.sensor
    ways = np.stack([_way(cast(ElectrodeEffect, start.effect), key, sensor) for key in start.along], axis=-1)
    columns = np.zeros((*problem.evidence.scan_v.shape, len(start.along)))
    for patch in problem.linear.patches:
        for k, state in enumerate(patch.states):
            columns[patch.rows[patch.state_of == k]] = np.einsum("plc,lcn->pn", state.pads, ways)
    return problem.evidence.discounted(
        np.where(problem.weight[:, None, None] > 0, columns / problem.evidence.noise_v, 0.0)
    )


def _way(effect: ElectrodeEffect, key: str, sensor: Sensor) -> Array:
    """(L,2) how electrodes move by a parameter of an effect, per metre."""
    small = effect.parameters()[key].typical
    moved = effect.changed({key: small}).geometry(sensor)
    return (moved.electrode_middle_m - sensor.electrode_middle_m) / small


def number_of(effect: Effect) -> int:
    """The electrode or channel that an effect belongs to, -1 for none."""
    return int(getattr(effect, "electrode", getattr(effect, "channel", -1)))


def _instrument(problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]]) -> list[Candidate]:
    """Effects that no resistor network explains, by what they'd explain of what none does."""
    protocol = problem.evidence.protocol
    if protocol.count <= protocol.orthonormal.shape[1]:
        return []
    signal = problem.acquisition
    skin = problem.family.skin(solved.calibration, solved.effects)
    wrong = signal.residual(skin)
    readings = (signal.scans(skin)[signal.rows] @ protocol.orthonormal.T).reshape(-1, *protocol.shape)
    present = {(t.name, number_of(t.effect)) for t in solved.terms}
    found: list[Candidate | None] = []
    for kind in effects_shown_by(Signal.NONRECIPROCAL):
        if kind.hypothesis.measured == Measured.READING_LIMIT and problem.evidence.saturated_v is not None:
            # It is known, and the readings that show it are left out.
            continue
        for start in kind.reading_starts(problem.evidence.sensor, protocol):
            if start.reciprocal or (kind.name, number_of(start.effect)) in present:
                continue
            if isinstance(start.effect, AcquisitionEffect) and not start.effect.linear:
                found.append(_bending(problem, solved, start, start.effect, partitions))
            elif isinstance(start.effect, AcquisitionEffect):
                found.append(_distorting(problem, start, start.effect, readings, wrong))
            else:
                found.append(_moving(problem, solved, start, partitions))
    return [candidate for candidate in found if candidate is not None]


def _distorting(
    problem: VoltageProblem, start: Start, effect: AcquisitionEffect, readings: Array, wrong: Array
) -> Candidate | None:
    """An effect on the readings (n,K,M), against what no network explains of them (n,K*M), in units of the noise."""
    protocol, noise = problem.evidence.protocol, problem.evidence.leftover_noise_v
    change = (effect.distorted_v(readings, protocol) - readings).reshape(len(readings), -1)
    met = readings_met(change)
    moved = change[:, met]
    # The residual has no reciprocal part, so only the pattern's length needs it taken off.
    along, longest = float((moved * wrong[:, met]).sum()) / noise, float((moved**2).sum()) / noise**2
    if longest <= 0 or along**2 * problem.leftover_share < 4.0 * LEAST_LEFTOVER * longest:
        return None
    square = longest - float(((moved @ protocol.orthonormal[met]) ** 2).sum()) / noise**2
    gain, share = _one_column(along, square, problem.leftover_share)
    (key,) = start.along
    known, size = effect.parameters()[key], float(getattr(effect, key))
    value = _inside(share * size, known)
    if value * size <= 0 and known.low >= 0:
        return None
    return Candidate(Term(effect.changed({key: value}), start.free), gain, gain)


def _bending(
    problem: VoltageProblem,
    solved: Solved,
    start: Start,
    effect: AcquisitionEffect,
    partitions: Sequence[Sequence[int]],
) -> Candidate | None:
    """An effect that isn't linear. What depends on a reading's size alone changes both readings of a reciprocal pair
    alike: the scans determine it, too."""
    signal, effect = problem.acquisition, effect.scaled_to(problem.acquisition.largest_v)
    scans = signal.scans(problem.family.skin(solved.calibration, solved.effects))
    change = (signal.distorted(scans, (effect,)) - scans) / problem.evidence.noise_v
    column = problem.evidence.discounted(np.where(problem.weight[:, None] > 0, change, 0.0))
    moved = beyond_networks(problem, solved, (effect,))
    return _through_both(problem, solved, replace(start, effect=effect), column, moved, partitions)


def _moving(
    problem: VoltageProblem, solved: Solved, start: Start, partitions: Sequence[Sequence[int]]
) -> Candidate | None:
    """An effect within the chain that no network explains either, such as a press that moves during its scan. The scans
    tell of it, too: on average it presses elsewhere."""
    signal, family = problem.acquisition, problem.family
    still = family.skin(solved.calibration, solved.effects)
    moving = family.skin(solved.calibration, (*solved.effects, start.effect))
    beyond = (signal.leftover(moving) - signal.leftover(still))[..., None]
    column = solved.scan_residual - problem.scan_residual(moving)
    return _through_both(problem, solved, start, column, lambda mine: beyond[mine], partitions)


def _through_both(
    problem: VoltageProblem,
    solved: Solved,
    start: Start,
    column: Array,
    moved: Moved,
    partitions: Sequence[Sequence[int]],
) -> Candidate | None:
    """The start by what it adds to the scans (T,P), in units of the noise, and to what no network explains."""
    gradient, hessian = with_columns(problem, solved, column[..., None], solved.scan_residual)
    by_scans = float(gradient[:, -1].sum()), float(hessian[:, -1, -1].sum())
    add_leftover(problem, solved, moved, gradient, hessian)
    prior = np.append(solved.fit.prior.diagonal(), 0.0)
    gain, step = held_out_gain(gradient, hessian, prior, solved.fit.from_prior, partitions)
    along, square = float(gradient[:, -1].sum()) - by_scans[0], float(hessian[:, -1, -1].sum()) - by_scans[1]
    (key,) = start.along
    known, size = start.effect.parameters()[key], float(getattr(start.effect, key))
    value = _inside(float(step[-1]) * size, known)
    if not np.isfinite(gain) or (value * size <= 0 and known.low >= 0):
        return None
    beyond = 0.5 * along**2 / square if along > 0 and square > 0 else 0.0
    return Candidate(Term(start.effect.changed({key: value}), start.free), gain, beyond)


def _one_column(along: float, square: float, share: float) -> tuple[float, float]:
    if square <= 0:
        return 0.0, 0.0
    return 0.5 * share * along**2 / square - 0.5, along / square
