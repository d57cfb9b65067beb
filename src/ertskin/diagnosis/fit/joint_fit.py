"""The joint fit: calibration and effects together, on scans, leftovers and specimen, in cells to hold out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ertskin.cores import in_threads
from ertskin.diagnosis.fit.bounded_step import Inequalities, Region, bounded_step
from ertskin.diagnosis.fit.full_scans import full_scans
from ertskin.diagnosis.fit.levenberg_marquardt import Fit, descend
from ertskin.diagnosis.fit.nonreciprocal import AcquisitionSignal, acquires
from ertskin.diagnosis.fit.quadratic import Quadratic
from ertskin.diagnosis.linear.calibration_vector import (
    CONTACT_SPREAD,
    SHAPE,
    WIDEST_RATIO,
    Calibration,
    SkinFamily,
    law_factors,
)
from ertskin.diagnosis.linear.linear_skin import Fields, LinearSkin
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.diagnosis.specimen.signal import SpecimenSignal
from ertskin.physics.effects.effect import AcquisitionEffect, Effect, ElectrodeEffect, Stage, shown_by
from ertskin.physics.effects.field_over_sheet import FieldOverSheet
from ertskin.physics.effects.hypothesis import Signal
from ertskin.physics.effects.smooth_field import Nodes, field_design
from ertskin.physics.piezo.polynomial import PiezoPolynomial
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]

LEAST_DAMPING = 1e-9
"""Of a step without a term, so that numbers the data hardly tell may go along a bound."""
LEAST_OHM, MOST_OHM = 1e-2, 1e9
"""Between which a sheet's and a contact's resistance are looked for at most."""
RATIO_PRIOR = 1.0
SHAPE_PRIOR = 0.3
HIGHER_PRIOR = 0.02
"""The law's coefficients above the fifth, which the paper's polynomial hasn't."""
LONGEST_CONTACT_STEP = 1.5
"""Of the logarithm of a contact resistance, in a step of the fit."""
STAYING = 0.5
"""Part of the least that a contact which wanders far has at rest, that it keeps while it is fitted."""
FARTHEST_CONTACT = 4.0
"""Of the logarithm of a contact resistance, from the one at rest and from most of those."""
REACH = 5.0
"""Times what is typical of a parameter: as far as a quadratic about the fit can be believed."""
SCALED = 0.7
"""The same for parameters that are always positive, over their value."""
LEAST_LAW = 1e-3
"""Part of the unpressed sheet's resistance that must be left under any pressure."""
MOST_FIELD = 5.0
"""Logarithm of a factor beyond which no fabric varies over the sheet: a step of the fit may ask for any."""
RAISED = 1e-3
"""By how much a field is raised for the derivatives by it."""
CONTACT_STEP = 1e-3
"""Of the logarithm of contact resistances, for their derivative: what drifts is added, what presses multiplies."""
LEFTOVER_FRAMES = 80
"""Frames whose non-reciprocal part is fitted; it counts as that of all."""


@dataclass(frozen=True, eq=False)
class Modes:
    """Fields over the sheet by their ``nodes`` (K,rows,columns): sums of them in which each has unit variance, and no
    mean, are what is expected of a field beforehand. They are the larger part of a process: of the covariance with
    this number, and of standard deviation ``spread``. ``by_place``: of what places pressed differ by alone, which tells
    of no other place."""

    nodes: Array
    covariance: int = 0
    spread: float = 0.0
    by_place: bool = False

    def of(self, sizes: Sequence[float]) -> Nodes:
        """Node values of the sum in which the modes have these ``sizes`` (K,)."""
        return tuple(tuple(map(float, row)) for row in np.tensordot(np.asarray(sizes), self.nodes, 1))

    def __call__(self, position_m: Array, extent_m: Array) -> Array:
        """(N,K) the modes at positions (N,2) of a sheet with the box ``extent_m`` (2,2)."""
        count, *shape = self.nodes.shape
        return np.asarray(field_design((shape[0], shape[1]), position_m, extent_m) @ self.nodes.reshape(count, -1).T)


@dataclass(frozen=True)
class Term:
    """An effect in a fit: where it starts and which parameters may move.

    A smooth field moves in its ``modes``, of which it has ``sizes`` (K,).
    """

    effect: Effect
    free: tuple[str, ...]
    modes: Modes | None = None
    sizes: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        return self.effect.name

    @property
    def by_place(self) -> bool:
        """Whether it is a field told place by place."""
        return self.modes is not None and self.modes.by_place

    @property
    def count(self) -> int:
        """How many numbers may move."""
        return len(self.free) + len(self.sizes)

    @property
    def start(self) -> list[float]:
        """The numbers that may move, where they are."""
        return [*map(self.effect.value, self.free), *self.sizes]

    def nearer(self, share: float) -> Term:
        """The term where only this share of it is there."""
        known = {key: self.effect.known(key) for key in self.free}
        defining = {key: self.effect.value(key) for key in self.free if known[key].defining}
        values: dict[str, Any] = {
            key: known[key].neutral + share * (value - known[key].neutral) for key, value in defining.items()
        }
        if nodes := getattr(self.effect, "nodes", ()):
            values["nodes"] = tuple(tuple(share * value for value in row) for row in nodes)
        return replace(self, effect=self.effect.changed(values), sizes=tuple(share * size for size in self.sizes))

    def at(self, numbers: Sequence[float]) -> Term:
        """The term with the numbers that may move at these values."""
        values: dict[str, Any] = dict(zip(self.free, map(float, numbers), strict=False))
        sizes = tuple(map(float, numbers[len(self.free) :]))
        if self.modes is not None:
            values["nodes"] = self.modes.of(sizes)
        return replace(self, effect=self.effect.changed(values), sizes=sizes)


@dataclass(frozen=True, eq=False)
class Solved:
    """A joint fit: its terms at their best values, the calibration, the quadratic about it.

    ``scan_residual`` (T,P) in units of the noise; parameters in the order calibration, then the terms' free ones.
    ``leftover``: whether what no resistor network explains is counted in the cost, too.
    """

    calibration: Calibration
    terms: tuple[Term, ...]
    fit: Fit
    scan_residual: Array
    leftover: bool = False

    @property
    def effects(self) -> tuple[Effect, ...]:
        return tuple(t.effect for t in self.terms)

    @property
    def cost(self) -> float:
        """Half chi-square over everything."""
        return float(self.fit.quadratic.cost.sum())

    def first(self, term: int) -> int:
        """Which of the fit's numbers is a term's first."""
        return len(self.fit.value) - sum(t.count for t in self.terms[term:])

    def rise_without(self, term: int, *, others_stay: bool = False) -> float:
        """Half chi-square and prior that are lost without a term, by the local model: its defining numbers neutral, its
        others and a field's sizes kept. ``others_stay``: only the calibration makes up for it, no other term does."""
        region = self.fit.region or Region(*np.full((2, len(self.fit.value)), [[-np.inf], [np.inf]]))
        low, high = region.low.copy(), region.high.copy()
        first, kept = self.first(term), self.terms[term]
        held = slice(self.first(0), None) if others_stay else slice(first, first + kept.count)
        low[held] = high[held] = self.fit.value[held]
        for number, key in enumerate(kept.free, first):
            if kept.effect.known(key).defining:
                low[number] = high[number] = kept.effect.known(key).neutral
        model = self.fit.local_model
        without = replace(region, low=low, high=high)
        return -model.promised(bounded_step(model, self.fit.value, without, damping=LEAST_DAMPING))

    def known(self, term: int, key: str) -> tuple[float, float]:
        """A free parameter's value and its standard error.

        The error is that of white residuals of their size, or the folds' if they pull the value about by more.
        """
        position = self.first(term) + self.terms[term].free.index(key)
        inflation = max(1.0, float((self.scan_residual**2).mean()))
        white = inflation * self.fit.covariance[position, position]
        error = float(np.sqrt(max(white, self.fit.robust_covariance[position, position], 0.0)))
        return self.terms[term].effect.value(key), error


@dataclass(eq=False)
class VoltageProblem:
    """Everything the fit needs. ``cells`` (T,) the cell of each frame, ``weight`` (T,) 0 for frames left out.

    ``correction_v`` (T,P): what the skin solved in full adds to the linearised one's scans, nought unless asked for.
    ``about``: the fit about which the skin is linearised, unless about where calibrating begins.
    """

    evidence: Evidence
    family: SkinFamily
    linear: LinearSkin
    specimen: SpecimenSignal | None
    cells: NDArray[np.intp]
    weight: Array
    correction_v: Array | float = 0.0
    about: Solved | None = None
    last_columns: tuple[NDArray[np.float32], Array] = field(init=False)
    last_leftover: tuple[NDArray[np.intp], Array] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        moving = np.flatnonzero(self.weight > 0)
        chosen = (
            moving[np.linspace(0, len(moving) - 1, min(len(moving), LEFTOVER_FRAMES)).astype(int)]
            if len(moving)
            else moving
        )
        self.acquisition = AcquisitionSignal(self.evidence, self.linear, np.unique(chosen))
        self.leftover_share = len(moving) / max(1, len(self.acquisition.rows))
        self.cell_count = int(self.cells.max()) + 1

    # residuals -----------------------------------------------------------------------------------------------------

    def scans(self, skin: Skin) -> Array:
        """(T,P) whitened scans in volt, as the instrument sees them."""
        return self.acquisition.scans(skin) + self.correction_v

    def scan_residual(self, skin: Skin) -> Array:
        """(T,P) in units of the noise, the excess noise of rest frames discounted."""
        wrong = (self.evidence.scan_v - self.scans(skin)) / self.evidence.noise_v
        return self.evidence.discounted(np.where(self.weight[:, None] > 0, wrong, 0.0))

    def _blocks(self, skin: Skin, with_leftover: bool = True) -> tuple[Array, Array, Array | None]:
        scan = self.scan_residual(skin)
        specimen = self.specimen.residual(skin) if self.specimen is not None else np.zeros(0)
        wanted = with_leftover and (acquires(skin.effects) or self._always_leftover)
        leftover = self.acquisition.residual(skin) if wanted else None
        return scan, specimen, leftover

    _always_leftover: bool = False
    reuse: bool = False
    _latest: Solved | None = None

    def in_full(self, solved: Solved, rows: NDArray[np.intp]) -> Array:
        """(n,P) whitened scans in volt of some rows by the fit's skin, solved in full."""
        skin = self.family.remeshed(solved.calibration, solved.effects)
        return full_scans(skin, self.linear.history, self.linear.force_n, self.linear.wanted[rows])

    def corrected(self, solved: Solved) -> VoltageProblem:
        """The same problem, exact where the fit has come to: every frame is solved in full there."""
        rows = np.flatnonzero(self.weight > 0)
        correction_v = np.zeros_like(self.evidence.scan_v)
        skin = self.family.skin(solved.calibration, solved.effects)
        correction_v[rows] = self.in_full(solved, rows) - self.acquisition.scans(skin)[rows]
        return replace(self, correction_v=correction_v)

    # fitting -------------------------------------------------------------------------------------------------------

    def solve(
        self,
        terms: Sequence[Term],
        start: Calibration,
        *,
        steps: int = 15,
        leftover: bool = False,
        hopeless: float = np.inf,
    ) -> Solved:
        """Best calibration and effects; ``leftover`` counts the non-reciprocal part even without a term in it. A fit
        that is still above half a chi-square of ``hopeless`` when begun is left at that."""
        self._always_leftover = leftover
        layout = _Layout(tuple(terms), len(start.vector()))
        begin = np.concatenate([start.vector(), *[t.start for t in terms]])
        mean, precision = layout.prior(self.family.first.contact_resistance_ohm)
        longest = np.full(len(begin), np.inf)
        longest[1 : layout.ratio] = LONGEST_CONTACT_STEP
        fit = descend(
            lambda x: self._linearise(layout, x),
            lambda x: self._cost(layout, x),
            begin,
            Region(
                *layout.bounds(self.family.first.contact_resistance_ohm),
                layout.law_above(self.family.first.piezo, 2 * LEAST_LAW),
            ),
            mean,
            precision,
            steps=steps,
            longest=longest,
            # Derivatives of an earlier fit aren't this one's slopes.
            secants=not self.reuse,
            hopeless=hopeless,
        )
        calibration, solved = layout.split(fit.value)
        skin = self.family.skin(calibration, [t.effect for t in solved])
        counted = leftover or acquires(skin.effects)
        self._latest = Solved(calibration, solved, fit, self.scan_residual(skin), counted)
        return self._latest

    def at_hand(self, solved: Solved) -> Solved:
        """The fit, or one step on from it, with its derivatives in ``last_columns``, where the latest fit's lie."""
        if solved is self._latest:
            return solved
        return self.solve(solved.terms, solved.calibration, steps=1, leftover=solved.leftover)

    def _skin(self, layout: _Layout, x: Array) -> Skin:
        calibration, terms = layout.split(x)
        return self.family.skin(calibration, [t.effect for t in terms])

    def _cost(self, layout: _Layout, x: Array) -> float:
        skin = self._skin(layout, x)
        if skin.piezo.least_ohm_sq <= LEAST_LAW * skin.piezo.zero_ohm_sq or _varies_most(skin.effects) > MOST_FIELD:
            # There is no such sheet; linearised, it wouldn't show.
            return np.inf
        scan, specimen, leftover = self._blocks(skin)
        total = float((scan**2).sum() + (specimen**2).sum())
        if leftover is not None:
            total += self.leftover_share * float((leftover**2).sum())
        return 0.5 * total

    def _linearise(self, layout: _Layout, x: Array) -> Quadratic:
        skin = self._skin(layout, x)
        scan, specimen, leftover = self._blocks(skin)
        count = len(x)
        columns = np.zeros((*scan.shape, count), dtype=np.float32)
        specimen_columns = np.zeros((len(specimen), count))
        instrument = [k for k in range(layout.calibration, count) if layout.is_instrument(k)]
        leftover_columns = np.zeros((0 if leftover is None else leftover.size, len(instrument)))
        electrodes = self.evidence.protocol.electrodes
        columns[..., 1 : 1 + electrodes] = self.evidence.discounted(self.contact_columns(skin))
        known = self._known_columns(layout)
        if known is not None:
            columns[..., : layout.calibration], specimen_columns[:, : layout.calibration] = known
        else:
            law = [0, *range(layout.ratio + 1, layout.calibration)]
            columns[..., law] = self._law_columns(skin)
            self._fill_specimen(layout, x, law, specimen, specimen_columns)
        alone = [k for k in layout.parameters if layout.on_readings_alone(k)]
        if alone:
            columns[..., alone], beyond = self._instrument_columns(layout, x, alone)
            leftover_columns[:, [instrument.index(k) for k in alone]] = beyond
        # Another ratio of moduli is another field of pressure, which the next fit begins with: it comes last.
        others = [k for k in layout.parameters if k not in alone] + ([layout.ratio] if known is None else [])
        for k in others:
            size = layout.step(k, x)
            stepped = self._blocks(self._skin(layout, layout.moved(k, x)), leftover is not None and k in instrument)
            columns[..., k] = (scan - stepped[0]) / size
            specimen_columns[:, k] = (specimen - stepped[1]) / size
            if leftover is not None and stepped[2] is not None:
                leftover_columns[:, instrument.index(k)] = ((leftover - stepped[2]) / size).ravel()
        self._fill_fields(layout, skin, columns)
        self.last_columns = columns, specimen_columns
        self.last_leftover = None if leftover is None else (np.array(instrument, dtype=np.intp), leftover_columns)
        quadratic = self._quadratic(scan, columns, specimen, specimen_columns)
        if leftover is not None:
            self._add_leftover(quadratic, leftover, np.array(instrument, dtype=np.intp), leftover_columns)
        return quadratic

    def _law_columns(self, skin: Skin) -> Array:
        """(T,P,1+SHAPE) the scans' derivatives by the law, in units of the noise."""
        found = self._through(skin, self.linear.law_columns(skin, SHAPE))
        found *= np.where(self.weight[:, None, None] > 0, 1 / self.evidence.noise_v, 0.0)
        return self.evidence.discounted(found)

    def _instrument_columns(self, layout: _Layout, x: Array, which: Sequence[int]) -> tuple[Array, Array]:
        """Columns (T,P,n) of the scans, and (m,n) of the leftover, by numbers ``which`` that act on readings alone."""
        moved = [self._skin(layout, layout.moved(k, x)) for k in which]
        scan, beyond = self.acquisition.derivatives(self._skin(layout, x), moved)
        step = np.array([layout.step(k, x) for k in which])
        scan = np.where(self.weight[:, None, None] > 0, scan / self.evidence.noise_v / step, 0.0)
        return self.evidence.discounted(scan), beyond.reshape(-1, len(which)) / step

    def _fill_specimen(self, layout: _Layout, x: Array, which: Sequence[int], base: Array, columns: Array) -> None:
        """The specimen's columns (S,n) by the numbers ``which``, about its residuals ``base`` (S,)."""
        if self.specimen is None:
            return
        for k in which:
            stepped = self.specimen.residual(self._skin(layout, layout.moved(k, x)))
            columns[:, k] = (base - stepped) / layout.step(k, x)

    def _fill_fields(self, layout: _Layout, skin: Skin, columns: NDArray[np.float32]) -> None:
        """The columns (T,P,n) of smooth fields, by their modes."""
        extent_m = self.evidence.sensor.extent_m
        for term, where in layout.fields:
            modes = cast(Modes, layout.terms[term].modes)
            for rows, found in self.field_columns(skin, term, partial(modes, extent_m=extent_m)):
                columns[rows, :, where] = found

    def field_columns(self, skin: Skin, number: int, fields: Fields) -> Iterator[tuple[NDArray[np.intp], Array]]:
        """Rows (m,), and what each of K ``fields`` added to that of the skin's effect ``number`` changes of their
        scans, (m,P,K) in units of the noise."""
        raised_effect = cast(FieldOverSheet, skin.effects[number]).raised(RAISED)
        raised = replace(skin, effects=(*skin.effects[:number], raised_effect, *skin.effects[number + 1 :]))
        for rows, found in self.linear.field_columns(skin, raised, RAISED, fields):
            part = self.evidence.frames(rows).discounted(self._through(skin, found) / self.evidence.noise_v)
            yield rows, np.where(self.weight[rows, None, None] > 0, part, 0.0)

    def _known_columns(self, layout: _Layout) -> tuple[Array, Array] | None:
        """The calibration's columns of an earlier fit of this problem: they hardly depend on the terms."""
        if self.reuse and hasattr(self, "last_columns"):
            columns, specimen = self.last_columns
            # kept in single precision: they are most of the fit's memory
            return cast(Array, columns[..., : layout.calibration]), specimen[:, : layout.calibration]
        return None

    def _quadratic(
        self, scan: Array, columns: NDArray[np.float32], specimen: Array, specimen_columns: Array
    ) -> Quadratic:
        """By cell of frames, and one more cell for the specimen."""
        count = columns.shape[-1]
        found = Quadratic(
            np.zeros(self.cell_count + 1),
            np.zeros((self.cell_count + 1, count)),
            np.zeros((self.cell_count + 1, count, count)),
        )
        everything = np.arange(count)

        def add(cell: int) -> None:
            mine = (self.cells == cell) & (self.weight > 0)
            if mine.any():
                found.add(cell, scan[mine].ravel(), columns[mine].reshape(-1, count).astype(float), everything)

        in_threads(add, range(self.cell_count))
        found.add(self.cell_count, specimen, specimen_columns, everything)
        return found

    def _add_leftover(self, quadratic: Quadratic, leftover: Array, which: NDArray[np.intp], columns: Array) -> None:
        """What no network explains, (n,K*M) with the ``columns`` (n*K*M,c) of the numbers ``which`` (c,)."""
        design = columns.reshape(*leftover.shape, len(which))
        for cell in range(self.cell_count):
            mine = self.cells[self.acquisition.rows] == cell
            if mine.any():
                wrong = leftover[mine].ravel()
                quadratic.add(cell, wrong, design[mine].reshape(len(wrong), len(which)), which, self.leftover_share)

    def contact_columns(self, skin: Skin) -> Array:
        """(T,P,L) change of the scans per unit logarithm of each contact resistance, in units of the noise."""
        scaled = replace(skin, contact_resistance_ohm=np.exp(CONTACT_STEP) * skin.contact_resistance_ohm)
        per_logarithm = np.where(self.weight > 0, 1.0 / (CONTACT_STEP * self.evidence.noise_v), 0.0)
        # in single precision, as the fit keeps them
        columns = self.linear.contact_columns(skin, scaled) * per_logarithm[:, None, None].astype(np.float32)
        return cast(Array, columns)

    def _through(self, skin: Skin, columns: Array) -> Array:
        """Columns (T,P,n) of scans as the instrument makes them."""
        through = self.acquisition.on_columns(skin)
        if through is None:
            return columns
        return np.asarray(np.einsum("pq,tqk->tpk", through, columns, optimize=True))


def _varies_most(effects: Sequence[Effect]) -> float:
    """The largest logarithm that a field has at a node."""
    return max((float(np.abs(nodes).max()) for e in effects if (nodes := getattr(e, "nodes", ()))), default=0.0)


@dataclass(frozen=True)
class _Layout:
    """Which number of the vector means what."""

    terms: tuple[Term, ...]
    calibration: int

    @property
    def ratio(self) -> int:
        """Which number is the logarithm of the moduli's ratio."""
        return self.calibration - SHAPE - 1

    def split(self, x: Array) -> tuple[Calibration, tuple[Term, ...]]:
        terms = [term.at(x[k : k + term.count].tolist()) for term, k in zip(self.terms, self._first, strict=True)]
        return Calibration.of(x[: self.calibration]), tuple(terms)

    @cached_property
    def _first(self) -> list[int]:
        """Each term's first number."""
        return [self.calibration + sum(t.count for t in self.terms[:k]) for k in range(len(self.terms))]

    @cached_property
    def _named(self) -> dict[int, tuple[Term, str]]:
        """The terms' parameters by their number."""
        return {
            first + k: (term, key)
            for term, first in zip(self.terms, self._first, strict=True)
            for k, key in enumerate(term.free)
        }

    @property
    def parameters(self) -> list[int]:
        """The numbers that are parameters of effects; those of the instrument first, while a network that they leave as
        it is is remembered."""
        return sorted(self._named, key=lambda k: not self.is_instrument(k))

    @property
    def fields(self) -> list[tuple[int, slice]]:
        """Terms with a field in modes, by their place in the list, and which numbers are the modes' sizes."""
        return [
            (k, slice(first + len(term.free), first + term.count))
            for k, (term, first) in enumerate(zip(self.terms, self._first, strict=True))
            if term.modes is not None
        ]

    def is_instrument(self, index: int) -> bool:
        """Whether the number belongs to an effect that no resistor network explains."""
        return index in self._named and shown_by(self._named[index][0].effect, Signal.NONRECIPROCAL)

    def step(self, index: int, x: Array) -> float:
        """Finite-difference step, away from the upper bound."""
        if index < self.calibration:
            return 1e-3
        term, key = self._named[index]
        known = term.effect.known(key)
        size = 0.02 * known.typical
        return size if x[index] + size <= known.high else -size

    def moved(self, index: int, x: Array) -> Array:
        """The numbers with one moved by its step."""
        moved = x.copy()
        moved[index] += self.step(index, x)
        return moved

    def on_readings_alone(self, index: int) -> bool:
        """Whether the number belongs to an effect that leaves the network as it is."""
        effect = self._named[index][0].effect if index in self._named else None
        return effect is not None and effect.stage == Stage.ACQUISITION and isinstance(effect, AcquisitionEffect)

    def bounds(self, contact_ohm: Array) -> tuple[Array, Array]:
        """Lowest and highest numbers (n,); contacts stay near those at rest ``contact_ohm`` (L,) and most of these.

        Readings that leave driven electrodes out hardly tell a contact: a misfit would take it to where the skin, as
        linearised, is another one, or to where nothing is left of one that wanders.
        """
        count = self.calibration + sum(t.count for t in self.terms)
        low, high = np.full(count, -np.inf), np.full(count, np.inf)
        contacts, rested = slice(1, self.ratio), np.log(contact_ohm)
        low[: self.ratio], high[: self.ratio] = np.log(LEAST_OHM), np.log(MOST_OHM)
        low[contacts] = np.maximum(low[contacts], np.minimum(rested, np.median(rested)) - FARTHEST_CONTACT)
        taken = self._most_taken_ohm(len(contact_ohm))
        least = taken + STAYING * np.clip(contact_ohm - taken, 0.0, taken)
        low[contacts] = np.maximum(low[contacts], np.log(np.maximum(least, LEAST_OHM)))
        high[contacts] = np.minimum(high[contacts], np.maximum(rested, np.median(rested)) + FARTHEST_CONTACT)
        low[self.ratio], high[self.ratio] = -WIDEST_RATIO, WIDEST_RATIO
        for k, (term, key) in self._named.items():
            known = term.effect.known(key)
            low[k], high[k] = known.low, known.high
        return low, high

    def _most_taken_ohm(self, electrodes: int) -> Array:
        """(L,) ohm that the terms take off each contact at most."""
        wandering = (t.effect for t in self.terms if isinstance(t.effect, ElectrodeEffect))
        return np.sum([np.zeros(electrodes), *(effect.most_taken_ohm(electrodes) for effect in wandering)], axis=0)

    def law_above(self, law: PiezoPolynomial, least: float) -> Inequalities:
        """What keeps the law above this part of its value unpressed, under any pressure, as its shape moves."""
        known, by_shape = law_factors(law)
        rows = np.zeros((len(known), self.calibration + sum(t.count for t in self.terms)))
        rows[:, self.ratio + 1 : self.calibration] = by_shape
        return Inequalities(rows, least - known)

    def prior(self, contact_ohm: Array) -> tuple[Array, Array]:
        """Mean and precision (n,) of the numbers; contacts are like most of those at rest ``contact_ohm`` (L,)."""
        electrodes = len(contact_ohm)
        count = self.calibration + sum(t.count for t in self.terms)
        mean, precision = np.zeros(count), np.zeros(count)
        mean[1 : self.ratio] = np.median(np.log(contact_ohm))
        precision[1 : self.ratio] = CONTACT_SPREAD**-2
        for _, where in self.fields:
            precision[where] = 1.0
        precision[1 + electrodes] = RATIO_PRIOR**-2
        precision[2 + electrodes : self.calibration] = SHAPE_PRIOR**-2
        precision[7 + electrodes : self.calibration] = HIGHER_PRIOR**-2
        return mean, precision


def halfway(one: Solved, other: Solved) -> Solved:
    """Between two fits of the same terms: their numbers' means, the rest as in the ``other``."""
    middle = 0.5 * (one.fit.value + other.fit.value)
    calibration, terms = _Layout(other.terms, len(other.calibration.vector())).split(middle)
    return replace(other, calibration=calibration, terms=terms, fit=replace(other.fit, value=middle))


def held_out(solved: Solved, partitions: Sequence[Sequence[int]]) -> Array:
    """(len(partitions),) half chi-square of each held-out set of cells after one Newton step on all the others.

    None is foretold better than it is fitted: a step promises too much where the fit has not come to rest. Where such a
    step would take a term beyond ``REACH``, the other cells don't tell it (a spot that one press alone has met): as far
    as they don't, it is taken not to be there.
    """
    quadratic = solved.fit.quadratic
    cells = np.arange(len(quadratic.cost))
    result = np.zeros(len(partitions))
    shift = solved.fit.prior.diagonal()
    numbers = _numbers(solved)
    for k, out in enumerate(partitions):
        inside = ~np.isin(cells, out)
        hessian = quadratic.hessian[inside].sum(axis=0) + solved.fit.prior
        gradient = quadratic.gradient[inside].sum(axis=0) - shift * solved.fit.from_prior
        step = _step(hessian, gradient, numbers)
        for cell in out:
            change = -quadratic.gradient[cell] @ step + 0.5 * step @ quadratic.hessian[cell] @ step
            result[k] += quadratic.cost[cell] + max(change, 0.0)
    return result


@dataclass(frozen=True, eq=False)
class _Numbers:
    """A term's numbers (n,) in the vector of a fit: how far they may step, and the steps to where it is absent."""

    index: NDArray[np.intp]
    reach: Array
    away: Array


def _numbers(solved: Solved) -> list[_Numbers]:
    found = []
    for k, term in enumerate(solved.terms):
        known = [term.effect.known(key) for key in term.free]
        value = np.array([term.effect.value(key) for key in term.free])
        away = np.where([p.defining for p in known], np.array([p.neutral for p in known]) - value, 0.0)
        # A time constant is known by its logarithm rather, whatever is typical.
        scale = np.where([p.low > 0 for p in known], SCALED * value, 0.0)
        reach = np.maximum(REACH * np.array([p.typical for p in known]), scale)
        # One of several of a kind that the other cells don't tell says nothing of the others.
        single = np.array(["[" in key for key in term.free], dtype=bool)
        for which in (np.flatnonzero(~single), *np.flatnonzero(single)[:, None]):
            if len(which):
                found.append(_Numbers(solved.first(k) + which, reach[which], away[which]))
    return found


def _step(hessian: Array, gradient: Array, terms: Sequence[_Numbers]) -> Array:
    """The Newton step. Terms that would go beyond their reach are expected beforehand to be absent, give or take that
    reach; those that would go beyond it even so are taken away."""
    expected: list[_Numbers] = []
    held: list[_Numbers] = []
    step, hessian, gradient = np.zeros(len(gradient)), hessian.copy(), gradient.copy()
    while True:
        free = np.ones(len(step), dtype=bool)
        for term in held:
            free[term.index], step[term.index] = False, term.away
        pull = gradient[free] - hessian[np.ix_(free, ~free)] @ step[~free]
        matrix = hessian[np.ix_(free, free)]
        scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
        step[free] = np.linalg.lstsq(matrix / scale[:, None] / scale, pull / scale, rcond=1e-11)[0] / scale
        wild = [t for t in terms if t not in held and (np.abs(step[t.index]) > t.reach).any()]
        if not wild:
            return step
        held += [term for term in wild if term in expected]
        for term in wild:
            if term not in expected:
                hessian[term.index, term.index] += term.reach**-2
                gradient[term.index] += term.away * term.reach**-2
                expected.append(term)
