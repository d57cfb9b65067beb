"""What could be missing: for every effect the terms a fit starts from, screened by their gain to first order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.added_gain import added_gain
from ertskin.diagnosis.smooth_fields import best_field
from ertskin.diagnosis.voltage_fit import Solved, Term, VoltageProblem
from physics.effects.channel_gain import ChannelGain
from physics.effects.contact_pressure_dependence import ContactPressureDependence
from physics.effects.crosstalk import Crosstalk
from physics.effects.effect import AcquisitionEffect, Effect
from physics.effects.electrode_displacement import ElectrodeDisplacement
from physics.effects.indenter_offset import IndenterOffset
from physics.effects.piezo_creep import PiezoCreep
from physics.effects.piezo_hysteresis import PiezoHysteresis
from physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from physics.effects.scan_skew import ScanSkew
from physics.effects.sheet_anisotropy import SheetAnisotropy
from physics.effects.sheet_inhomogeneity import SheetInhomogeneity
from physics.effects.temperature_drift import TemperatureDrift

Array = NDArray[np.float64]

SPOTS = 5
"""Gaussian spots are tried at SPOTS x SPOTS places."""
LEAST_LEFTOVER = 0.05
"""Least part of an instrument's pattern expected to lie outside what a network could give."""
SCREENED_LENGTHS = (0.4,)
"""Correlation lengths of the smooth fields screened, over the sheet's longer side."""
SPOT_KEYS = ("amplitude", "x_m", "y_m", "radius_m")


@dataclass(frozen=True)
class Candidate:
    """A term to try, where it starts, and what screening expects it to gain (half chi-square, held out)."""

    term: Term
    gain: float

    @property
    def name(self) -> str:
        return self.term.name


def screen(problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]]) -> list[Candidate]:
    """Every term that isn't in the fit yet, best first."""
    found = [*_through_scans(problem, solved, partitions), *_electrodes(problem, solved, partitions)]
    found += _fields(problem, solved, partitions)
    found += _instrument(problem, solved)
    return sorted(found, key=lambda c: -c.gain)


def _through_scans(problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]]) -> list[Candidate]:
    here = problem.family.skin(solved.calibration, solved.effects)
    present = {t.name for t in solved.terms}
    base = problem.scan_residual(here)
    specimen = problem.specimen.residual(here) if problem.specimen is not None else np.zeros(0)
    found = []
    for probes, finish in _trials(problem, present):
        columns, specimen_columns, sizes = [], [], []
        for probe, size in probes:
            skin = problem.family.skin(solved.calibration, (*solved.effects, probe))
            columns.append((base - problem.scan_residual(skin)) / size)
            if problem.specimen is not None:
                specimen_columns.append((specimen - problem.specimen.residual(skin)) / size)
            sizes.append(size)
        extra = np.stack(specimen_columns, axis=-1) if specimen_columns else np.zeros((0, len(columns)))
        gain, value = added_gain(problem, solved, np.stack(columns, axis=-1), base, specimen, extra, partitions)
        if np.isfinite(gain) and np.isfinite(value).all():
            found.append(Candidate(finish(value), gain))
    return found


Probes = list[tuple[Effect, float]]


def _trials(problem: VoltageProblem, present: set[str]) -> list[tuple[Probes, Callable[[Array], Term]]]:
    """Probes whose columns go into the screening together, and the term their best values start."""
    trials: list[tuple[Probes, Callable[[Array], Term]]] = []

    def plain(effect: Effect, defining: tuple[str, ...], free: tuple[str, ...]) -> None:
        if effect.name in present:
            return
        known = effect.parameters()
        probes: Probes = [(effect.changed({key: known[key].typical}), known[key].typical) for key in defining]

        def finish(value: Array) -> Term:
            limited = {
                k: float(np.clip(v, known[k].low * 0.9, known[k].high * 0.9))
                for k, v in zip(defining, value, strict=True)
            }
            return Term(effect.changed(limited), free)

        trials.append((probes, finish))

    plain(PiezoHysteresis(), ("width",), ("width",))
    for time_s, remembers in ((1.0, False), (5.0, False), (30.0, False), (30.0, True), (300.0, True)):
        plain(PiezoCreep(time_s=time_s, remembers_air=remembers), ("fraction",), ("fraction", "time_s"))
    ladder = PiezoCreep(time_s=0.3, decades=4.0, remembers_air=True)
    plain(ladder, ("fraction",), ("fraction", "time_s", "decades"))
    plain(replace(ladder, multiplies=True), ("fraction",), ("fraction", "time_s", "decades"))
    for sensitivity in (2e-5, 3e-4, 3e-3):
        _loaded_contacts(trials, sensitivity, present)
    placement = ("dx_m", "dy_m", "rotation_rad")
    plain(IndenterOffset(), placement, placement)
    plain(TemperatureDrift(), ("rate_per_h", "bend_per_h2"), ("rate_per_h", "bend_per_h2"))
    for settle_h in (0.03, 0.3):
        plain(TemperatureDrift(settle_h=settle_h), ("rate_per_h",), ("rate_per_h", "settle_h"))
    plain(SheetAnisotropy(), ("stretch_x", "stretch_diagonal"), ("stretch_x", "stretch_diagonal"))
    slope = ("gradient_x", "gradient_y")
    low, high = problem.evidence.sensor.extent_m
    radius = 0.6 * float((high - low).min()) / SPOTS
    for kind in (PiezoInhomogeneity, SheetInhomogeneity):
        plain(kind(), slope, slope)
        for x in np.linspace(low[0], high[0], 2 * SPOTS + 1)[1::2]:
            for y in np.linspace(low[1], high[1], 2 * SPOTS + 1)[1::2]:
                plain(kind(x_m=float(x), y_m=float(y), radius_m=radius), ("amplitude",), SPOT_KEYS)
    return trials


def _loaded_contacts(
    trials: list[tuple[Probes, Callable[[Array], Term]]], sensitivity: float, present: set[str]
) -> None:
    """A contact's dependence on pressure can't be negative: the probe is its full size, the value its share."""
    effect = ContactPressureDependence(sensitivity_per_pa=sensitivity)
    if effect.name in present:
        return

    def finish(value: Array) -> Term:
        share = float(np.clip(value[0], 0.05, 20.0))
        return Term(effect.changed({"sensitivity_per_pa": sensitivity * share}), ("sensitivity_per_pa", "bend"))

    trials.append(([(effect, 1.0)], finish))


def _fields(problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]]) -> list[Candidate]:
    """Properties that vary smoothly over the sheet, without the wild guesses of a spot where nothing has pressed."""
    present = {t.name for t in solved.terms}
    found = []
    for kind in (PiezoInhomogeneity, SheetInhomogeneity):
        if kind.name not in present:
            gain, nodes = best_field(problem, solved, (*solved.effects,), kind(), partitions, SCREENED_LENGTHS)
            if nodes is not None:
                found.append(Candidate(Term(kind(nodes=nodes), ("gradient_x", "gradient_y")), gain))
    return found


def _electrodes(problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]]) -> list[Candidate]:
    """Displaced pads, from the shape derivatives the states hold."""
    if problem.evidence.sensor.electrode_edge_m is not None:
        return []
    present = {t.effect.electrode for t in solved.terms if isinstance(t.effect, ElectrodeDisplacement)}
    base = solved.scan_residual
    specimen = np.zeros(0)
    found = []
    for electrode in set(range(problem.evidence.protocol.electrodes)) - present:
        columns = np.zeros((*base.shape, 2))
        for patch in problem.linear.patches:
            for k, state in enumerate(patch.states):
                columns[patch.rows[patch.state_of == k]] = state.pads[:, electrode]
        columns = np.where(problem.weight[:, None, None] > 0, columns / problem.evidence.noise_v, 0.0)
        gain, value = added_gain(
            problem, solved, problem.evidence.discounted(columns), base, specimen, np.zeros((0, 2)), partitions
        )
        if not (np.isfinite(gain) and np.isfinite(value).all()):
            continue
        shift = np.clip(value, -5e-3, 5e-3)
        effect = ElectrodeDisplacement(electrode, float(shift[0]), float(shift[1]))
        found.append(Candidate(Term(effect, ("dx_m", "dy_m")), gain))
    return found


def _instrument(problem: VoltageProblem, solved: Solved) -> list[Candidate]:
    """Effects of the acquisition, by what they'd explain of the readings no network gives."""
    signal = problem.acquisition
    skin = problem.family.skin(solved.calibration, solved.effects)
    protocol, noise = problem.evidence.protocol, problem.evidence.leftover_noise_v
    if protocol.orthonormal.shape[0] <= protocol.orthonormal.shape[1]:
        return []
    wrong = signal.residual(skin)
    before = signal.leftover(skin)
    found = []
    electrodes = protocol.shape[1]
    present = {(t.name, getattr(t.effect, "channel", -1)) for t in solved.terms}
    probes: list[tuple[AcquisitionEffect, str, float]] = []
    for channel in range(electrodes):
        probes += [
            (ChannelGain(channel, gain=0.01), "gain", 0.01),
            (ChannelGain(channel, offset_v=0.01), "offset_v", 0.01),
        ]
    for way in ("channel", "injection"):
        probes.append((Crosstalk(fraction=0.01, before=way), "fraction", 0.01))
        probes += [(Crosstalk(fraction=0.01, channel=c, before=way), "fraction", 0.01) for c in range(electrodes)]
    readings = (problem.acquisition.scans(skin)[signal.rows] @ protocol.orthonormal.T).reshape(-1, *protocol.shape)
    basis = protocol.orthonormal
    for effect, key, size in probes:
        if (effect.name, effect.channel) in present:  # type: ignore[attr-defined]
            continue
        moved = (effect.distorted_v(readings, protocol) - readings).reshape(len(readings), -1)
        # The residual has no reciprocal part, so only the pattern's length needs it taken off.
        along, longest = float((moved * wrong).sum()) / noise, float((moved**2).sum()) / noise**2
        if longest <= 0 or along**2 * problem.leftover_share < 4.0 * LEAST_LEFTOVER * longest:
            continue
        square = longest - float(((moved @ basis) ** 2).sum()) / noise**2
        gain, share = _one_column(along, square, problem.leftover_share)
        known = effect.parameters()[key]
        value = float(np.clip(share * size, known.low * 0.9, known.high * 0.9))
        if value * size <= 0 and known.low >= 0:
            continue
        free = ("gain", "offset_v") if isinstance(effect, ChannelGain) else (key,)
        found.append(Candidate(Term(effect.changed({key: value}), free), gain))
    if protocol.injection_offset_s is not None and "scan_skew" not in {t.name for t in solved.terms}:
        found += _skew(problem, solved, wrong, before)
    return found


def _skew(problem: VoltageProblem, solved: Solved, wrong: Array, before: Array) -> list[Candidate]:
    known = ScanSkew.parameters()["speed_m_per_s"]
    last_s = float(np.max(np.asarray(problem.evidence.protocol.injection_offset_s)))
    found = []
    for at_s in (0.0, 0.5 * last_s, last_s):
        skin = problem.family.skin(solved.calibration, (*solved.effects, ScanSkew(known.typical, at_s)))
        column = (problem.acquisition.leftover(skin) - before) / problem.evidence.leftover_noise_v
        gain, share = _one_column(float((column * wrong).sum()), float((column**2).sum()), problem.leftover_share)
        if share > 0:
            value = float(np.clip(share * known.typical, 1e-6, 0.9 * known.high))
            found.append(Candidate(Term(ScanSkew(value, at_s), ("speed_m_per_s", "at_s")), gain))
    return found


def _one_column(along: float, square: float, share: float) -> tuple[float, float]:
    if square <= 0:
        return 0.0, 0.0
    return 0.5 * share * along**2 / square - 0.5, along / square
