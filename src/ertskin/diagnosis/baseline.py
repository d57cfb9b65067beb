"""The simulator as calibration leaves it: support, law, pad, resting contacts; where every diagnosis starts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.evidence import CannotTell, Evidence
from ertskin.diagnosis.force_fit import ForceData, ForceFit, select_force_effects
from ertskin.diagnosis.resting import rested
from ertskin.diagnosis.specimen_signal import SpecimenSignal
from ertskin.diagnosis.specimen_stage import SpecimenFinding, SpecimenTest, specimen_findings
from hardware.recording import Recording
from physics.calibration.indenter_support import indenter_support
from physics.calibration.specimen import fit_specimen
from physics.effects.effect import Effect
from physics.skin import Skin

Array = NDArray[np.float64]

FORCE_SIGNIFICANT = 10.0
FORCE_MATERIAL = 1.05


@dataclass(frozen=True, eq=False)
class Baseline:
    """``skin`` calibrated at rest, the force stage without and with its effects, forces (T,C) that drive it.

    ``noise_v`` of a whitened scan's numbers, ``stray`` (P,k) and ``traces`` (T,P,m) for the evidence.
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
    traces: Array


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
    skin, ratio, drift, noise_v, stray, traces = rested(skin, evidence)
    if best is not None:
        skin = replace(skin, pad_n_per_m=best.pad_n_per_m, effects=(*best.effects, *drift))
    force = _driving_force(evidence, best)
    signal = SpecimenSignal.of(specimen, law.noise_fraction)
    findings, noise = specimen_findings(SpecimenTest(signal.stress_pa, signal.resistance_ohm_sq, signal.time_s))
    signal = replace(signal, noise_fraction=noise)
    return Baseline(skin, plain, best, noise_n, force, signal, tuple(findings), drift, ratio, noise_v, stray, traces)


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
