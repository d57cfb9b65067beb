"""The simulator as calibration leaves it: support, law, pad, resting contacts; where every diagnosis starts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.evidence import CannotTell, Evidence
from ertskin.diagnosis.force_fit import ForceData, ForceFit, select_force_effects
from ertskin.diagnosis.specimen_signal import SpecimenSignal
from ertskin.diagnosis.specimen_stage import SpecimenFinding, SpecimenTest, specimen_findings
from hardware.recording import Recording
from physics.calibration.indenter_support import indenter_support
from physics.calibration.specimen import fit_specimen
from physics.effects.contact_drift import ContactDrift
from physics.effects.effect import Effect
from physics.skin import Skin

Array = NDArray[np.float64]

FORCE_SIGNIFICANT = 10.0
FORCE_MATERIAL = 1.05
ROUNDS = 30
ENOUGH_RESTS = 5
COLOURED = 0.05
"""Excess of the rest frames' scatter over the readings' noise that is taken for coloured noise."""


@dataclass(frozen=True, eq=False)
class Baseline:
    """``skin`` calibrated at rest, the force stage without and with its effects, forces (T,C) that drive it.

    ``noise_v`` of a whitened scan's numbers and ``stray`` (P,k), as the rest frames scatter.
    """

    skin: Skin
    force_plain: ForceFit | None
    force_best: ForceFit | None
    force_noise_n: float
    force_n: Array
    specimen: SpecimenSignal
    specimen_findings: tuple[SpecimenFinding, ...]
    drift: tuple[Effect, ...]
    rest_ratio: float
    noise_v: float
    stray: Array


def calibrated(recording: Recording, evidence: Evidence, resolution: str = "fine") -> Baseline:
    """Raises ``CannotTell`` where the recording lacks what the simulator needs."""
    if recording.specimen is None:
        raise CannotTell("no specimen test: the fabric's law, and so the simulator, is unknown")
    if not evidence.sensor.layers:
        raise CannotTell("the sensor names no layers: the pressure under a contact is unknown")
    specimen = recording.specimen
    try:
        law = fit_specimen(specimen.stress_pa, specimen.sheet_resistance_ohm_sq, specimen.time_s, specimen.cycle)
    except ValueError as error:
        raise CannotTell(f"the specimen test can't be used: {error}") from None
    support, share = np.inf, 1e-3
    scatter = float("nan")
    if recording.rigid_block is not None:
        found = indenter_support(recording.rigid_block.depth_m, recording.rigid_block.force_n)
        support, scatter = found.stiffness_n_per_m, found.force_noise_n
        share = max(found.standard_error_n_per_m / found.stiffness_n_per_m, 1e-5)
    noise_n = _force_noise_n(evidence, scatter)
    plain, best = _force_stage(evidence, support, share, noise_n)
    contacts = np.full(evidence.protocol.electrodes, max(evidence.sensor.contact_resistance_guess_ohm, 10.0))
    skin = Skin.build(evidence.sensor, evidence.protocol, law.law, contacts, support, (), resolution)
    skin, ratio, drift, noise_v, stray = _rested(skin, evidence)
    if best is not None:
        skin = replace(skin, pad_n_per_m=best.pad_n_per_m, effects=(*best.effects, *drift))
    force = _driving_force(evidence, best)
    signal = SpecimenSignal.of(specimen, law.noise_fraction)
    findings, noise = specimen_findings(SpecimenTest(signal.stress_pa, signal.resistance_ohm_sq, signal.time_s))
    signal = replace(signal, noise_fraction=noise)
    return Baseline(skin, plain, best, noise_n, force, signal, tuple(findings), drift, ratio, noise_v, stray)


def _force_noise_n(evidence: Evidence, scatter_n: float) -> float:
    """The load cell's noise: in air, on the rigid block, and between presses that repeat the same strokes."""
    history = evidence.history
    squares, weights = [], []
    if np.isfinite(evidence.air_n):
        squares.append(evidence.air_n**2)
        weights.append(max(int(evidence.rest.sum()) - 1, 1))
    if np.isfinite(scatter_n) and scatter_n > 0:
        squares.append(scatter_n**2)
        weights.append(19)
    if not squares:
        return 0.01
    quiet = float(np.sqrt(np.average(squares, weights=weights)))
    repeats = _pure_error(history.depth_m[:, 0], history.force_n[:, 0], history.press, history.phase)
    return repeats if repeats is not None and 0.7 * quiet < repeats < 1.5 * quiet else quiet


def _pure_error(depth_m: Array, force_n: Array, press: NDArray[np.int64], phase: NDArray[np.uint8]) -> float | None:
    """Scatter in newton of frames at the same step of presses with the same strokes."""
    groups: dict[tuple[int, int, int], list[float]] = {}
    for number in np.unique(press):
        rows = np.flatnonzero(press == number)
        for step, t in enumerate(rows):
            if np.isfinite(force_n[t]) and np.isfinite(depth_m[t]):
                groups.setdefault((step, int(phase[t]), round(1e6 * float(depth_m[t]))), []).append(float(force_n[t]))
    scattered = [(np.var(v, ddof=1), len(v) - 1) for v in groups.values() if len(v) > 4]
    if not scattered:
        return None
    variance, weight = np.array(scattered).T
    return float(np.sqrt(np.average(variance, weights=weight)))


def _force_stage(
    evidence: Evidence, support: float, error: float, noise_n: float
) -> tuple[ForceFit | None, ForceFit | None]:
    foam_m = evidence.sensor.layers[0].thickness_m
    stiff = support if np.isfinite(support) else 1e9
    data = ForceData(evidence.history, noise_n, stiff, error, foam_m)
    if data.used.sum() < 20:
        return None, None
    plain, best, _ = select_force_effects(data, evidence.history.press % 3, FORCE_SIGNIFICANT)
    return plain, best


def _driving_force(evidence: Evidence, best: ForceFit | None) -> Array:
    """Forces that drive the skin: the force stage's where it fits to the noise, else the load cell's."""
    history = evidence.history
    measured = np.where(history.touched, history.force_n, 0.0)
    if best is None:
        if not np.isfinite(history.force_n[history.touched]).any():
            raise CannotTell("neither forces nor a force-depth curve: the simulator can't be driven")
        return np.nan_to_num(measured)
    count = int(np.isfinite(best.residual).sum())
    fits = np.sqrt(best.chi_square / max(count, 1)) < 1.1
    predicted = np.where(history.touched, best.force_n, 0.0)
    return np.where(np.isfinite(measured), predicted if fits else measured, np.nan_to_num(predicted))


def _rested(skin: Skin, evidence: Evidence) -> tuple[Skin, float, tuple[Effect, ...], float, Array]:
    """Contact and sheet resistances from the rest frames by Gauss-Newton in logarithms, their drift, and the noise."""
    protocol = evidence.protocol
    good = evidence.rest & np.isfinite(evidence.scan_v).all(axis=1)
    scans = evidence.scan_v[good]
    mean = scans.mean(axis=0)
    contacts, zero = np.array(skin.contact_resistance_ohm), skin.piezo.zero_ohm_sq
    for _ in range(ROUNDS):
        solution = skin.sheet.solve(skin.sheet.uniform(zero), contacts)
        slope = protocol.whitened(solution.jacobian_contact_resistance().T).T
        scan = protocol.whitened(solution.pair_resistance_ohm)
        columns = np.column_stack([slope * contacts, scan - slope @ contacts])
        step = np.linalg.lstsq(columns, mean - scan, rcond=None)[0]
        contacts = np.clip(contacts * np.exp(np.clip(step[:-1], -1.5, 1.5)), 0.1, 1e7)
        zero = zero * float(np.exp(np.clip(step[-1], -0.3, 0.3)))
        if np.abs(step).max() < 1e-6:
            break
    wrong = (mean - scan) / evidence.noise_v * np.sqrt(len(scans))
    ratio = float(np.sqrt((wrong**2).mean()))
    skin = replace(skin, piezo=skin.piezo.scaled(zero), contact_resistance_ohm=contacts)
    return skin, ratio, _contact_drift(evidence, good, columns, contacts), *_scatter(scans, columns, evidence.noise_v)


def _scatter(scans: Array, columns: Array, reading_v: float) -> tuple[float, Array]:
    """Noise of a whitened scan's numbers, and the directions (P,k) in which rest frames (R,P) scatter more than that.

    From second differences of the rest frames, in which a steady drift is nothing. Coloured noise weighs more in the
    scans than in what no network explains; contacts that jitter do so along their ``columns`` (P,n). The median over
    the frames lets a few odd ones pass, and white noise within its own scatter leaves the reading's noise as it is.
    """
    count, width = scans.shape
    space = np.linalg.qr(columns)[0]
    freedom = width - space.shape[1]
    if count < ENOUGH_RESTS or freedom <= 0:
        return reading_v, np.zeros((width, 0))
    jump = np.diff(scans, n=2, axis=0) / np.sqrt(6)
    inside = jump @ space
    outside = float(np.median(((jump - inside @ space.T) ** 2).sum(axis=1))) / freedom
    noise_v = max(reading_v, float(np.sqrt(outside))) if outside > ((1 + COLOURED) * reading_v) ** 2 else reading_v
    size, axes = np.linalg.eigh(inside.T @ inside / len(jump) / noise_v**2)
    # Beyond what white noise alone gives the largest eigenvalue (Marchenko and Pastur).
    more = size > (1 + np.sqrt(len(size) / len(jump))) ** 2
    return noise_v, space @ axes[:, more] * np.sqrt(size[more] - 1)


def _contact_drift(evidence: Evidence, good: NDArray[np.bool_], columns: Array, contacts: Array) -> tuple[Effect, ...]:
    """What each contact did over the recording, from its rest frames, where they wander beyond the noise."""
    scans = evidence.scan_v[good]
    time_s = evidence.history.time_s[good]
    if len(scans) < 5:
        return ()
    inverse = np.linalg.pinv(columns)
    moved = (scans - scans.mean(axis=0)) @ inverse.T
    error = evidence.noise_v * np.sqrt((inverse**2).sum(axis=1))
    drifts: list[Effect] = []
    for k in range(len(contacts)):
        if moved[:, k].std() > 2.0 * error[k]:
            ohm = contacts[k] * _smoothed(moved[:, k], error[k])
            drifts.append(ContactDrift(k, tuple(time_s.tolist()), tuple(ohm.tolist())))
    return tuple(drifts)


def _smoothed(path: Array, error: float) -> Array:
    """A random walk seen through noise, by the Kalman smoother, its step size from the path's own increments."""
    step = max(float(np.mean(np.diff(path) ** 2)) - 2 * error**2, 1e-4 * error**2)
    mean, variance = np.zeros(len(path)), np.zeros(len(path))
    m, v = float(path[0]), error**2
    for k, seen in enumerate(path):
        if k:
            v += step
            gain = v / (v + error**2)
            m, v = m + gain * (seen - m), (1 - gain) * v
        mean[k], variance[k] = m, v
    for k in range(len(path) - 2, -1, -1):
        back = variance[k] / (variance[k] + step)
        mean[k] += back * (mean[k + 1] - mean[k])
    return mean
