"""The simulator as calibration leaves it: support, law, pad, resting contacts; where every diagnosis starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.force.fit import ForceData, ForceFit
from ertskin.diagnosis.force.noise import ForceNoise, pressed_noise, quiet_noise
from ertskin.diagnosis.force.selection import select_force_effects
from ertskin.diagnosis.recording.evidence import CannotTell, Evidence
from ertskin.diagnosis.recording.split import folds_of
from ertskin.diagnosis.rest.displaced_pad import displaced_pad
from ertskin.diagnosis.rest.rest_frames import Noise, guessed_ohm, rested
from ertskin.diagnosis.specimen.fit import SpecimenFinding, SpecimenTest, specimen_findings
from ertskin.diagnosis.specimen.signal import SpecimenSignal
from ertskin.hardware.recording import Recording
from ertskin.physics.calibration.indenter_support import IndenterSupport, indenter_support
from ertskin.physics.calibration.specimen import SpecimenFit, fit_specimen
from ertskin.physics.effects.effect import ElectrodeEffect, Start, shown_by
from ertskin.physics.effects.hypothesis import Signal
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]

SURER = 2**0.5
"""Misfit over the load cell's noise below which what depths tell errs by less than the cell does."""
FORCE_FOLDS = 3
"""Folds of presses by which the foam's effects are chosen."""
UNYIELDING = 1e9, 1e-3
"""Stiffness in newton per metre, and its relative error, of a support that no rigid block has tested."""


@dataclass(frozen=True, eq=False)
class Baseline:
    """``skin`` calibrated at rest, the force stage without and with its effects and the ``force_data`` it explains,
    forces (T,C) that drive the skin.

    ``displaced`` a pad that can't be where it should; ``noise`` of whitened scans; electrodes whose contacts are
    ``settling``; ``traces`` (T,P,m) for the evidence; ``warmth`` name of the effect that warms the sheet, if the rest
    frames clearly show one.
    """

    skin: Skin
    force_linear: ForceFit | None
    force_best: ForceFit | None
    force_noise: ForceNoise
    force_data: ForceData | None
    force_n: Array
    specimen: SpecimenSignal
    specimen_findings: tuple[SpecimenFinding, ...]
    displaced: ElectrodeEffect | None
    noise: Noise
    settling: frozenset[int]
    traces: Array
    warmth: str | None

    @property
    def shown_by_force_and_readings(self) -> set[str]:
        """Names of effects that belong to the skin because force and readings together show them."""
        return {e.name for e in self.skin.effects if shown_by(e, Signal.FORCE) and shown_by(e, Signal.READINGS)}

    @property
    def linear_force_n(self) -> Array:
        """(T,C) forces in newton by a linear pad from depth, where the load cell shows effects."""
        if self.force_linear is None or self.force_best is None or not self.force_best.effects:
            return self.force_n
        linear_n = self.force_linear.force_n
        return np.where(np.isfinite(linear_n) & (self.force_n > 0), linear_n, self.force_n)


def calibrated(recording: Recording, evidence: Evidence, resolution: str = "fine") -> Baseline:
    """Raises ``CannotTell`` where the recording lacks what the simulator needs."""
    law = _law(recording)
    if not evidence.sensor.layers:
        raise CannotTell("the sensor names no layers: the pressure under a contact is unknown")
    support = _support(recording)
    data, linear, best, noise = _force_stage(evidence, support)
    contacts = np.full(evidence.protocol.electrodes, guessed_ohm(evidence.sensor))
    built = Skin.build(evidence.sensor, evidence.protocol, law.law, contacts, support.stiffness_n_per_m, (), resolution)
    at_rest = rested(built, evidence)
    skin = at_rest.skin
    displaced = displaced_pad(skin, at_rest.scan_v, at_rest.scan_noise_v, at_rest.misfit, evidence.criteria, resolution)
    drifting = at_rest.drifting
    skin = replace(skin, effects=drifting.effects, contact_resistance_ohm=drifting.usual_ohm)
    if best is not None:
        skin = replace(skin, pad_n_per_m=best.pad_n_per_m, effects=(*best.foam, *drifting.effects))
    signal, findings = _specimen(recording, law, evidence)
    return Baseline(
        skin=skin,
        force_linear=linear,
        force_best=best,
        force_noise=noise,
        force_data=data,
        force_n=_driving_force(evidence, best, noise),
        specimen=signal,
        specimen_findings=findings,
        displaced=displaced,
        noise=at_rest.noise,
        settling=drifting.settling,
        traces=at_rest.traces,
        warmth=at_rest.warmth,
    )


def _law(recording: Recording) -> SpecimenFit:
    """The fabric's law from its specimen."""
    specimen = recording.specimen
    if specimen is None:
        raise CannotTell("no specimen test: the fabric's law, and so the simulator, is unknown")
    try:
        return fit_specimen(specimen.stress_pa, specimen.sheet_resistance_ohm_sq, specimen.time_s, specimen.cycle)
    except ValueError as error:
        raise CannotTell(f"the specimen test can't be used: {error}") from None


def _support(recording: Recording) -> IndenterSupport:
    """The indenter's support from its rigid block; without one it doesn't give way, and no force was measured."""
    block = recording.rigid_block
    if block is None:
        return IndenterSupport(np.inf, np.inf, 0.0, float("nan"))
    try:
        return indenter_support(block.depth_m, block.force_n)
    except ValueError as error:
        raise CannotTell(f"the rigid block's curve can't be used: {error}") from None


def _specimen(
    recording: Recording, law: SpecimenFit, evidence: Evidence
) -> tuple[SpecimenSignal, tuple[SpecimenFinding, ...]]:
    """The specimen's signal with the effects that it shows by itself."""
    assert recording.specimen is not None
    signal = SpecimenSignal.of(recording.specimen, law.noise_fraction)
    test = SpecimenTest(signal.stress_pa, signal.resistance_ohm_sq, signal.time_s)
    findings, scatter = specimen_findings(test, evidence.criteria)
    effects = tuple(finding.effect for finding in findings)
    return replace(signal, noise_fraction=scatter, effects=effects), tuple(findings)


def force_fits(data: ForceData, evidence: Evidence, begun: Sequence[Start] = ()) -> tuple[ForceFit, ForceFit]:
    """The fits of forces without and with effects, beginning with those ``begun``."""
    folds, criteria = folds_of(evidence.history.press, FORCE_FOLDS), evidence.criteria
    return select_force_effects(data, folds, criteria.significant_force_gain, criteria.second_force_share, begun)


def _force_stage(
    evidence: Evidence, support: IndenterSupport
) -> tuple[ForceData | None, ForceFit | None, ForceFit | None, ForceNoise]:
    """The forces, their fits without and with effects, and the load cell's noise; searched on with the noise that the
    first shows."""
    quiet = quiet_noise(evidence, support.force_noise_n)
    stiff, error = UNYIELDING
    if np.isfinite(support.stiffness_n_per_m):
        stiff = support.stiffness_n_per_m
        error = max(support.standard_error_n_per_m / stiff, 1e-5)
    foam_m = evidence.sensor.layers[0].thickness_m
    data = ForceData(evidence.history, quiet.rms_n, stiff, error, foam_m, evidence.protocol.duration_s)
    if data.used.sum() < 20:
        return None, None, None, quiet
    _, best = force_fits(data, evidence)
    noise = pressed_noise(evidence.history, best.residual * quiet.rms_n, quiet)
    data = replace(data, noise_n=noise.rms_n)
    return data, *force_fits(data, evidence, best.terms), noise


def _driving_force(evidence: Evidence, best: ForceFit | None, noise: ForceNoise) -> Array:
    """Forces that drive the skin: the force stage's unless it surely misses more than the noise, or errs by as much as
    the load cell, else the load cell's.

    The cell's noise drives the skin too: a tenth of a light press is several times what readings scatter by.
    """
    history = evidence.history
    measured = np.where(history.touched, history.force_n, 0.0)
    if best is None:
        if not np.isfinite(history.force_n[history.touched]).any():
            raise CannotTell("neither forces nor a force-depth curve: the simulator can't be driven")
        return np.nan_to_num(measured)
    count = int(np.isfinite(best.residual).sum())
    rmse_n = noise.rms_n * float(np.sqrt(best.chi_square / max(count, 1)))
    fits = rmse_n < SURER * noise.rms_n and not noise.exceeded(rmse_n, count, evidence.criteria)
    predicted = np.where(history.touched, best.force_n, 0.0)
    better = np.isfinite(predicted) & (fits | ~np.isfinite(measured))
    return np.nan_to_num(np.where(better, predicted, measured))
