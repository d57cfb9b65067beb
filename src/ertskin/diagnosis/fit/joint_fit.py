"""The joint fit: calibration and effects together, on scans, leftovers and specimen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ertskin.cores import in_threads
from ertskin.diagnosis.fit.bounded_step import Region
from ertskin.diagnosis.fit.full_scans import full_scans
from ertskin.diagnosis.fit.layout import Layout
from ertskin.diagnosis.fit.levenberg_marquardt import descend
from ertskin.diagnosis.fit.nonreciprocal import AcquisitionSignal, acquires
from ertskin.diagnosis.fit.quadratic import Quadratic
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Modes, Term
from ertskin.diagnosis.linear.calibration_vector import SHAPE, WIDEST_RATIO, Calibration, SkinFamily
from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.diagnosis.linear.whole_sheet import Fields
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.diagnosis.specimen.signal import SpecimenSignal
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.field_over_sheet import FieldOverSheet
from ertskin.physics.effects.piezo_chain import LEAST_RELATIVE, response_power
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]

LONGEST_CONTACT_STEP = 1.5
"""Of the logarithm of a contact resistance, in a step of the fit."""
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


@dataclass(eq=False)
class VoltageProblem:
    """Everything the fit needs. ``cells`` (T,) the cell of each frame, ``weight`` (T,) 0 for frames left out.

    ``correction_v`` (T,P): what the skin solved in full adds to the linearised one's scans, nought unless asked for.
    ``about``: the fit about which the skin is linearised, unless about where calibrating begins. ``widest_ratio``:
    how far the logarithm of the moduli's ratio may go.
    """

    evidence: Evidence
    family: SkinFamily
    linear: LinearSkin
    specimen: SpecimenSignal | None
    cells: NDArray[np.intp]
    weight: Array
    correction_v: Array | float = 0.0
    about: Solved | None = None
    widest_ratio: float = WIDEST_RATIO
    last_columns: tuple[NDArray[np.float32], Array] = field(init=False)
    last_leftover: tuple[NDArray[np.intp], Array] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        moving = np.flatnonzero(self.weight > 0)
        chosen = moving[np.linspace(0, len(moving) - 1, min(len(moving), LEFTOVER_FRAMES)).astype(int)]
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
        layout = Layout(tuple(terms), len(start.vector()))
        begin = np.concatenate([start.vector(), *[t.start for t in terms]])
        mean, precision = layout.prior(self.family.first.contact_resistance_ohm)
        longest = np.full(len(begin), np.inf)
        longest[1 : layout.ratio] = LONGEST_CONTACT_STEP
        fit = descend(
            lambda x: self._linearise(layout, x),
            lambda x: self._cost(layout, x),
            begin,
            Region(
                *layout.bounds(self.family.first.contact_resistance_ohm, self.widest_ratio),
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

    def _skin(self, layout: Layout, x: Array) -> Skin:
        calibration, terms = layout.split(x)
        return self.family.skin(calibration, [t.effect for t in terms])

    def _cost(self, layout: Layout, x: Array) -> float:
        skin = self._skin(layout, x)
        if _law_is_gone(skin) or _varies_most(skin.effects) > MOST_FIELD:
            # There is no such sheet; linearised, it wouldn't show.
            return np.inf
        scan, specimen, leftover = self._blocks(skin)
        total = float((scan**2).sum() + (specimen**2).sum())
        if leftover is not None:
            total += self.leftover_share * float((leftover**2).sum())
        return 0.5 * total

    def _linearise(self, layout: Layout, x: Array) -> Quadratic:
        skin = self._skin(layout, x)
        scan, specimen, leftover = self._blocks(skin)
        count = len(x)
        columns = np.zeros((*scan.shape, count), dtype=np.float32)
        specimen_columns = np.zeros((len(specimen), count))
        instrument = [k for k in range(layout.calibration, count) if layout.is_instrument(k)]
        # Column by column: numbers written far from one another take longer than what they come from.
        leftover_columns = np.zeros((len(instrument), *((0,) if leftover is None else leftover.shape)))
        self.evidence.work.add(columns.size * self.linear.instants(skin) + leftover_columns.size)
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
            columns[..., _together(alone)], beyond = self._instrument_columns(layout, x, alone)
            if leftover is not None:
                leftover_columns[[instrument.index(k) for k in alone]] = beyond
        # Another ratio of moduli is another field of pressure, which the next fit begins with: it comes last.
        others = [k for k in layout.parameters if k not in alone] + ([layout.ratio] if known is None else [])
        for k in others:
            size = layout.step(k, x)
            stepped = self._blocks(self._skin(layout, layout.moved(k, x)), leftover is not None and k in instrument)
            columns[..., k] = (scan - stepped[0]) / size
            specimen_columns[:, k] = (specimen - stepped[1]) / size
            if leftover is not None and stepped[2] is not None:
                leftover_columns[instrument.index(k)] = (leftover - stepped[2]) / size
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

    def _instrument_columns(self, layout: Layout, x: Array, which: Sequence[int]) -> tuple[Array, Array]:
        """Columns (T,P,c) of the scans, and (c,n,K*M) of the leftover, by numbers ``which`` (c,) that act on readings
        alone."""
        moved = [self._skin(layout, layout.moved(k, x)) for k in which]
        scan, beyond = self.acquisition.derivatives(self._skin(layout, x), moved)
        step = np.array([layout.step(k, x) for k in which])
        scan *= np.where(self.weight > 0, 1 / self.evidence.noise_v, 0.0)[:, None, None] / step
        beyond /= step[:, None, None]
        return self.evidence.discounted(scan), beyond

    def _fill_specimen(self, layout: Layout, x: Array, which: Sequence[int], base: Array, columns: Array) -> None:
        """The specimen's columns (S,n) by the numbers ``which``, about its residuals ``base`` (S,)."""
        if self.specimen is None:
            return
        for k in which:
            stepped = self.specimen.residual(self._skin(layout, layout.moved(k, x)))
            columns[:, k] = (base - stepped) / layout.step(k, x)

    def _fill_fields(self, layout: Layout, skin: Skin, columns: NDArray[np.float32]) -> None:
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

    def _known_columns(self, layout: Layout) -> tuple[Array, Array] | None:
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
        """What no network explains, (n,K*M) with the ``columns`` (c,n,K*M) of the numbers ``which`` (c,)."""
        for cell in range(self.cell_count):
            mine = self.cells[self.acquisition.rows] == cell
            if mine.any():
                wrong = leftover[mine].ravel()
                design = columns[:, mine].reshape(len(which), len(wrong)).T
                quadratic.add(cell, wrong, design, which, self.leftover_share)

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
        return np.asarray(np.matmul(through.astype(columns.dtype), columns))


def _together(which: Sequence[int]) -> Sequence[int] | slice:
    """Which columns are meant, as a slice where they lie side by side: written so in a tenth of the time."""
    return slice(which[0], which[-1] + 1) if list(which) == list(range(which[0], which[-1] + 1)) else which


def _law_is_gone(skin: Skin) -> bool:
    """Whether nothing to speak of is left of the sheet's resistance under some pressure."""
    least = skin.piezo.least_ohm_sq / skin.piezo.zero_ohm_sq
    power = response_power(skin.effects, skin.sheet.quadrature_m.mean(axis=1), skin.sensor.extent_m)
    return least <= LEAST_LAW or (power is not None and least ** float(power.max()) <= LEAST_RELATIVE)


def _varies_most(effects: Sequence[Effect]) -> float:
    """The largest logarithm that a field has at a node."""
    return max((float(np.abs(nodes).max()) for e in effects if (nodes := getattr(e, "nodes", ()))), default=0.0)
