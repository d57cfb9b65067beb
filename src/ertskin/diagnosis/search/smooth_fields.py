"""A property that varies over the sheet, as one hypothesis: a Gaussian process whose lengths the data choose.

The fit's quadratic is taken once by the values of a field on a grid of nodes; every covariance is then a matter of
small matrices. Lengths run from the grid's spacing to twice the sheet, along and across lines in all directions too.
The covariance is the mean of those tried, each by how well it predicts cells held out, and the spread the one that
predicts best with it, for what is handed on are predictions: evidence would have lengths that follow every press, and
takes what the form of pressure and fabric leaves for a wide spread (Bachoc, Comput. Stat. Data Anal. 66 (2013) 55:
where the model is wrong, cross-validation is the more robust).
Of the process those modes enter the joint fit that the data tell of (Spantini and others, SIAM J. Sci. Comput. 37
(2015) A2451): where nothing has pressed the field stays as it is expected beforehand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.cells_held_out import held_out
from ertskin.diagnosis.fit.cross_validation import log_misfit, log_misfits, numbers_of
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Modes, Term
from ertskin.diagnosis.search.first_order_gain import held_out_gain
from ertskin.diagnosis.search.forms import beginnings
from ertskin.diagnosis.search.gain import freedom
from ertskin.physics.effects.effect import Effect, Start
from ertskin.physics.effects.field_over_sheet import FieldOverSheet
from ertskin.physics.effects.smooth_field import field_design, node_position_m

Array = NDArray[np.float64]

NODE_M = 8e-3
MOST_NODES = 300
"""The nodes lie ``NODE_M`` apart, further where there would be more than that."""
LENGTHS = 2.0, 1.0, 0.5, 0.25, 0.13, 0.07
"""Correlation lengths tried, over the sheet's longer side."""
ACROSS, ALONG, ANGLES = (0.25, 0.13, 0.07), 3.0, 12
"""The same across and along lines, and the directions in which they are tried."""
LINES = 4
"""How many of those along lines are tried on cells held out."""
SPREADS = (0.003, 0.01, 0.03, 0.1, 0.3)
"""Standard deviations of the field tried."""
LEAST_VARIANCE = 1e-3
"""Part of the largest mode's variance from which on down modes of a covariance are left out."""
LEAST_WEIGHT = 1e-3
"""Of a covariance, over that of the best one, from which on down it is left out of their mean."""
LEAST_INFORMATION = 0.02
"""Information on a mode, over that beforehand, from which on it enters the fit."""
MOST_MODES = 100
SAMPLES = 3
"""Points for every node, along each side, at which a field's form is read."""
STARTS = 8192
"""Starts of fields of few numbers whose values at the nodes are remembered: of two properties all of a sheet's."""
PASSES = 2
STEPS = 5
FARTHEST = 2.0
"""Logarithm of a factor up to which a field is begun, as far as a spot's may go: about a poor fit first order asks for
any."""


def node_shape(extent_m: Array) -> tuple[int, int]:
    """Rows and columns of the nodes over a sheet's box (2,2)."""
    size = extent_m[1] - extent_m[0]
    apart = max(NODE_M, float(np.sqrt(size.prod() / MOST_NODES)))
    columns, rows = (max(3, round(float(side) / apart) + 1) for side in size)
    return rows, columns


@dataclass(frozen=True, eq=False)
class NodeQuadratic:
    """A fit's quadratic with the values of a field at M nodes behind its other numbers: half chi-square ``cost`` (F,),
    gradient (F,n+M) and Hessian (F,n+M,n+M) by cell of so many ``numbers`` (F,) and ``presses`` (F,); ``prior`` (n,) of
    the other numbers, ``value`` (n,) theirs from its mean. The field counts from nought. Numbers added to the fit come
    before the field's and are counted with them."""

    cost: Array
    numbers: Array
    presses: Array
    gradient: Array
    hessian: Array
    prior: Array
    value: Array

    @classmethod
    def of(
        cls,
        problem: VoltageProblem,
        current: Solved,
        effects: Sequence[Effect],
        number: int,
        added: NDArray[np.float32] | None = None,
    ) -> NodeQuadratic:
        """About a fit, by the field of the effect ``number`` of ``effects``; the fit's own modes of it are left out.
        ``added`` (T,P,c): what numbers added to the fit change of its scans, in units of the noise."""
        extent_m = problem.evidence.sensor.extent_m
        shape = node_shape(extent_m)
        others = _others(current, number)
        count, nodes = int(others.sum()), shape[0] * shape[1]
        behind = nodes + (0 if added is None else added.shape[-1])
        quadratic = current.fit.quadratic
        gradient = np.zeros((len(quadratic.cost), count + behind))
        hessian = np.zeros((len(quadratic.cost), count + behind, count + behind))
        gradient[:, :count] = quadratic.gradient[:, others]
        hessian[:, :count, :count] = quadratic.hessian[:, others][:, :, others]
        known = problem.last_columns[0][..., others]
        skin = problem.family.skin(current.calibration, tuple(effects))
        for rows, by_node in problem.field_columns(skin, number, partial(field_design, shape, extent_m=extent_m)):
            columns = by_node if added is None else np.concatenate([added[rows], by_node], axis=-1)
            for cell in np.unique(problem.cells[rows]):
                mine = problem.cells[rows] == cell
                new = columns[mine].reshape(-1, behind).astype(float)
                old = known[rows[mine]].reshape(-1, count).astype(float)
                gradient[cell, count:] += new.T @ current.scan_residual[rows[mine]].ravel()
                hessian[cell, count:, count:] += new.T @ new
                hessian[cell, :count, count:] += old.T @ new
        hessian[:, count:, :count] = hessian[:, :count, count:].transpose(0, 2, 1)
        cost = quadratic.cost.copy()
        if (field := np.ravel(getattr(effects[number], "nodes", ()))).size:
            from_nought = hessian[:, :, -nodes:] @ field
            cost += (gradient + 0.5 * from_nought)[:, -nodes:] @ field
            gradient += from_nought
        prior, value = current.fit.prior.diagonal()[others], current.fit.from_prior[others]
        numbers = np.append(numbers_of(problem, [[k] for k in range(problem.cell_count)]), 0.0)
        return cls(cost, numbers, np.append(_presses_of(problem), 0.0), gradient, hessian, prior, value)

    def along(self, directions: Array, precision: float, partitions: Sequence[Sequence[int]]) -> tuple[float, Array]:
        """Held-out gain of fields (M,K) beside the other numbers, and how much of each (K,)."""
        count = len(self.value)
        onto = np.zeros((self.gradient.shape[1], count + directions.shape[1]))
        onto[:count, :count] = np.eye(count)
        onto[count:, count:] = directions
        prior = np.concatenate([self.prior, np.full(directions.shape[1], precision)])
        gain, step = held_out_gain(self.gradient @ onto, onto.T @ self.hessian @ onto, prior, self.value, partitions)
        return gain, step[count:]

    def reduced(self) -> tuple[Array, Array]:
        """Gradient (M,) and Hessian (M,M) of the field alone, the other numbers at their best for each."""
        return self._apart(self.gradient.sum(axis=0), self.hessian.sum(axis=0))[2:]

    def _apart(self, gradient: Array, hessian: Array) -> tuple[Array, Array, Array, Array]:
        """The other numbers' best step (n,) without a field, and what it is more by the field (n,M); then gradient (M,)
        and Hessian (M,M) of the field alone."""
        count = len(self.value)
        own = hessian[:count, :count] + np.diag(self.prior)
        scale = np.sqrt(np.maximum(np.diag(own), 1e-300))
        inverse = np.linalg.pinv(own / scale[:, None] / scale, rcond=1e-10, hermitian=True) / scale[:, None] / scale
        others, by_field = inverse @ (gradient[:count] - self.prior * self.value), -inverse @ hessian[:count, count:]
        cross = hessian[count:, :count]
        return others, by_field, gradient[count:] - cross @ others, hessian[count:, count:] + cross @ by_field

    def fold(self, out: Sequence[int]) -> Fold:
        """What cells held ``out`` would say of a field that the others tell."""
        count = len(self.value)
        inside = ~np.isin(np.arange(len(self.gradient)), out)
        within = self.gradient[inside].sum(axis=0), self.hessian[inside].sum(axis=0)
        others, by_field, gradient, hessian = self._apart(*within)
        slope, curved = self.gradient[~inside].sum(axis=0), self.hessian[~inside].sum(axis=0)
        through = np.vstack([by_field, np.eye(len(by_field.T))])
        left = slope - curved[:, :count] @ others
        return Fold(
            gradient,
            hessian,
            float(self.cost[~inside].sum() - 0.5 * (slope + left)[:count] @ others),
            float(self.numbers[~inside].sum()),
            float(self.presses[~inside].sum()),
            through.T @ left,
            through.T @ curved @ through,
        )


@dataclass(frozen=True, eq=False)
class Fold:
    """Of a field (M,): gradient and Hessian by the cells inside, and by those held out, the other numbers following;
    half chi-square ``out_cost`` of those without the field, and how many numbers and presses they hold."""

    gradient: Array
    hessian: Array
    out_cost: float
    out_numbers: float
    out_presses: float
    out_gradient: Array
    out_hessian: Array

    def gain(self, modes: Array) -> float:
        """Half chi-square that the field in ``modes`` (M,K) gains in the cells held out, each of unit variance."""
        matrix = np.eye(modes.shape[1]) + modes.T @ self.hessian @ modes
        field = modes @ np.linalg.solve(matrix, modes.T @ self.gradient)
        return float(field @ self.out_gradient - 0.5 * field @ self.out_hessian @ field)


def _presses_of(problem: VoltageProblem) -> Array:
    """(F,) how many presses each cell holds."""
    press, touched = problem.evidence.history.press, problem.evidence.history.touched.any(axis=1)
    fitted = (problem.weight > 0) & touched
    cells = (np.unique(press[fitted & (problem.cells == k)]).size for k in range(problem.cell_count))
    return np.array([*cells], dtype=float)


def _others(current: Solved, number: int) -> NDArray[np.bool_]:
    """Which numbers of a fit aren't sizes of modes of the term ``number``."""
    others = np.ones(len(current.fit.value), dtype=bool)
    if number < len(current.terms):
        others[current.sizes(number)] = False
    return others


@lru_cache(maxsize=4)
def _covariances(shape: tuple[int, int], box: tuple[float, ...]) -> list[Array]:
    """Halves (M,J) of the covariances tried, of unit variance: Matern's of order 3/2, even and along lines.

    Between places known precisely a squared exponential overshoots (Stein, Interpolation of Spatial Data, 1999).
    """
    extent_m = np.reshape(box, (2, 2))
    side = float(np.ptp(extent_m, axis=0).max())
    return [_half(shape, extent_m, side * np.array(lengths), angle) for lengths, angle in _kinds()]


def covariance_half(extent_m: Array, length: float) -> Array:
    """Half (M,J) of the even covariance with this one of ``LENGTHS``."""
    return covariances(extent_m)[LENGTHS.index(length)]


def _kinds() -> Iterator[tuple[tuple[float, float], float]]:
    yield from (((length, length), 0.0) for length in LENGTHS)
    yield from (((across, ALONG), np.pi / ANGLES * k) for across in ACROSS for k in range(ANGLES))


def covariances(extent_m: Array) -> list[Array]:
    """Halves (M,J) of the covariances tried on a sheet of this box (2,2), of unit variance."""
    return _covariances(node_shape(extent_m), tuple(map(float, extent_m.ravel())))


def _half(shape: tuple[int, int], extent_m: Array, length_m: Array, angle: float) -> Array:
    node = node_position_m(shape, extent_m)
    turned = node @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) / length_m
    apart = np.sqrt(3 * ((turned[:, None] - turned) ** 2).sum(axis=-1))
    variance, vector = np.linalg.eigh((1 + apart) * np.exp(-apart))
    kept = variance > LEAST_VARIANCE * variance.max()
    return np.asarray(vector[:, kept] * np.sqrt(variance[kept]))


@dataclass(frozen=True, eq=False)
class Process:
    """A Gaussian process by half (M,J) of its covariance, of unit variance, its standard deviation and its modes (M,K)
    that the data tell of, with their most likely ``sizes`` (K,). ``gain``: what it, or the one of those tried that does
    best, gains in cells held out, in half chi-square, or as ``log_misfit`` has it where that is more."""

    half: Array
    spread: float
    modes: Array
    sizes: Array
    gain: float

    def of(self, term: Term, extent_m: Array) -> list[Term]:
        """The term with a smooth field in these modes, in each way in which that may begin, or as it is.

        A mean that the calibration makes up for is left to it: as each mode has one, whatever a field's shape asks for
        would take calibration and field far apart, where the skin, linearised, is another one.
        """
        told = cast(FieldOverSheet, term.effect).has_a_mean
        flat, half = (self.modes, self.half) if told else (_of_no_mean(self.modes), _of_no_mean(self.half))
        modes = Modes(flat.T.reshape(-1, *node_shape(extent_m)), half, self.spread)
        farthest = float(np.abs(flat @ self.sizes).max())
        sizes = tuple(map(float, self.sizes * min(1.0, FARTHEST / max(farthest, 1e-12))))
        begun = beginnings(term) if term.modes is None else [term]
        smooth = (replace(one, modes=modes, sizes=sizes) for one in begun)
        return [one.at(one.start) for one in smooth]


def _of_no_mean(fields: Array) -> Array:
    """Fields (M,K) by their values at the nodes, each about its mean."""
    return np.asarray(fields - fields.mean(axis=0))


class _Told(NamedTuple):
    """What cells held out say of a covariance and a ``spread``: ``misfit`` and ``gain`` as ``log_misfit`` has them,
    ``missed`` with each press as a single number; modes and their sizes."""

    misfit: float
    missed: float
    gain: float
    spread: float
    modes: Array
    sizes: Array


def predictive(quadratic: NodeQuadratic, extent_m: Array, partitions: Sequence[Sequence[int]]) -> Process:
    """The process that cells held out expect, to first order.

    Each covariance tried counts by how well it predicts them with the spread that suits it, each press as a single
    number: most of what it is missed by comes from what the field is at its place. The best of ten is often so by
    chance where a dozen presses judge. The spread is the one that predicts best with their mean.
    """
    gradient, hessian = quadratic.reduced()
    folds = [quadratic.fold(out) for out in partitions]
    names = "out_cost", "out_numbers", "out_presses"
    costs, numbers, presses = (np.array([getattr(fold, name) for fold in folds]) for name in names)

    def of_spread(half: Array) -> list[_Told]:
        """By each of the ``SPREADS``."""
        found = []
        for spread in SPREADS:
            modes, sizes = _informed_modes(half, spread, gradient, hessian)
            left = costs - np.array([fold.gain(modes) for fold in folds])
            misfit, missed = log_misfit(left, numbers), float(presses @ log_misfits(left, numbers))
            gain = max(float((costs - left).sum()), log_misfit(costs, numbers) - misfit)
            found.append(_Told(misfit, missed, gain, spread, modes, sizes))
        return found

    halves = covariances(extent_m)
    tried = [halves[number] for number in _likely(halves, gradient, hessian)]
    told = [of_spread(half) for half in tried]
    missed = np.array([min(one.missed for one in each) for each in told])
    half = _mean_half(tried, np.exp(missed.min() - missed))
    best = min(of_spread(half), key=lambda one: one.misfit)
    # Whether it is tried hangs on what the best of them promises: a fit with it is judged by itself.
    most = min((one for each in told for one in each), key=lambda one: one.misfit)
    return Process(half, best.spread, best.modes, best.sizes, max(best.gain, most.gain))


def _mean_half(halves: Sequence[Array], weight: Array) -> Array:
    """Half (M,J) of the weighted mean of covariances by their halves (M,J)."""
    weight = np.where(weight > LEAST_WEIGHT, weight, 0.0) / weight[weight > LEAST_WEIGHT].sum()
    mean = sum(w * half @ half.T for w, half in zip(weight, halves, strict=True) if w)
    variance, vector = np.linalg.eigh(np.asarray(mean))
    kept = variance > LEAST_VARIANCE * variance.max()
    return np.asarray(vector[:, kept] * np.sqrt(variance[kept]))


def node_covariance(modes: Modes, known: Array) -> Array:
    """(M,M) covariance of a field's node values, of whose modes the covariance ``known`` (K,K) is what a fit leaves.

    What of the process isn't in the modes is as unknown as beforehand.
    """
    flat = modes.nodes.reshape(len(modes.nodes), -1)
    return np.asarray(modes.spread**2 * modes.half @ modes.half.T + flat.T @ (known - np.eye(len(known))) @ flat)


def evidences(half: Array, gradient: Array, hessian: Array, spreads: Sequence[float] = SPREADS) -> Array:
    """(S,) logarithm of the evidence for a covariance (M,J) of each of the ``spreads``, over that without a field."""
    size, vector = np.linalg.eigh(half.T @ hessian @ half)
    along = (vector.T @ (half.T @ gradient)) ** 2
    variance = np.square(spreads)[:, None]
    information = variance * np.maximum(size, 0.0)
    return np.asarray(0.5 * (variance * along / (1 + information) - np.log1p(information)).sum(axis=1))


def _informed_modes(half: Array, spread: float, gradient: Array, hessian: Array) -> tuple[Array, Array]:
    """Modes (M,K) that the data tell of and their most likely sizes (K,), of a covariance's half (M,J)."""
    size, vector = np.linalg.eigh(half.T @ hessian @ half)
    information = spread**2 * np.maximum(size, 0.0)
    kept = np.flatnonzero(information > LEAST_INFORMATION)
    kept = kept[np.argsort(-information[kept])][:MOST_MODES]
    modes = spread * half @ vector[:, kept]
    return modes, modes.T @ gradient / (1 + information[kept])


def _likely(halves: Sequence[Array], gradient: Array, hessian: Array) -> list[int]:
    """Which covariances to try: all even ones, and of those along lines the ``LINES`` of the largest evidence."""
    first = len(LENGTHS)
    evidence = [float(evidences(half, gradient, hessian).max()) for half in halves[first:]]
    return [*range(first), *(first + int(k) for k in np.argsort(evidence)[::-1][:LINES])]


def at_nodes(start: Start, extent_m: Array) -> Array:
    """(M,c) fields at the nodes, by the parameters that a start goes along: what it is everywhere, spread over them."""
    return _at_nodes(start, tuple(map(float, extent_m.ravel())))


@lru_cache(maxsize=STARTS)
def _at_nodes(start: Start, box: tuple[float, ...]) -> Array:
    extent_m = np.reshape(box, (2, 2))
    position_m, onto = _onto_nodes(node_shape(extent_m), box)
    known = start.effect.parameters()
    columns = []
    for key in start.along:
        effect = cast(FieldOverSheet, start.effect.changed({key: known[key].typical}))
        columns.append(onto @ effect.logarithm(position_m, extent_m) / known[key].typical)
    found = np.stack(columns, axis=1)
    found.flags.writeable = False
    return found


@lru_cache(maxsize=4)
def _onto_nodes(shape: tuple[int, int], box: tuple[float, ...]) -> tuple[Array, Array]:
    """Points (N,2) all over the sheet, and the least-squares fit (M,N) of node values to values there."""
    extent_m = np.reshape(box, (2, 2))
    position_m = node_position_m((SAMPLES * shape[0], SAMPLES * shape[1]), extent_m)
    return position_m, np.asarray(np.linalg.pinv(field_design(shape, position_m, extent_m)), dtype=float)


def with_smooth_fields(problem: VoltageProblem, current: Solved, partitions: Sequence[Sequence[int]]) -> Solved:
    """The fit with a smooth field in each property that varies, where that is worth it."""
    for number, term in enumerate(current.terms):
        for _ in range(PASSES if term.effect.hypothesis.field and not term.by_place else 0):
            freed = with_smooth_field(problem, current, number, partitions)
            if freed is None:
                break
            current = freed
    return current


def with_smooth_field(
    problem: VoltageProblem,
    current: Solved,
    number: int,
    partitions: Sequence[Sequence[int]],
    least: float = -np.inf,
) -> Solved | None:
    """The fit with a term's field in the modes that the data tell of about this fit; None where they gain too little,
    or are expected to gain less than the ``least`` (half chi-square, held out).

    Cells held out must be predicted better; a field that isn't smooth yet must gain evidence, too.
    """
    current, extent_m = problem.at_hand(current), problem.evidence.sensor.extent_m
    quadratic = NodeQuadratic.of(problem, current, current.effects, number)
    process = predictive(quadratic, extent_m, partitions)
    if process.gain < least or not process.modes.size or not np.isfinite(process.sizes).all():
        return None
    before, after = current.terms[:number], current.terms[number + 1 :]
    freed = min(
        (
            problem.solve([*before, term, *after], current.calibration, steps=STEPS, leftover=current.leftover)
            for term in process.of(current.terms[number], extent_m)
        ),
        key=lambda fit: fit.cost,
    )
    numbers = numbers_of(problem, partitions)
    missed = [log_misfit(held_out(fit, partitions), numbers) for fit in (current, freed)]
    gain = missed[0] - missed[1]
    if current.terms[number].modes is None:
        gain = min(gain, current.cost + freedom(current) - freed.cost - freedom(freed))
    return freed if gain > problem.evidence.criteria.significant_gain else None
