"""The material of a training: trials simulated on the calibrated skin, and what its recording adds."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import hydra
import numpy as np
from numpy.typing import NDArray
from omegaconf import DictConfig, OmegaConf

from ertskin.calibration.ready import ready_calibration
from ertskin.calibration.rest_slopes import rest_slopes_v
from ertskin.data.discrepancy import Discrepancy
from ertskin.data.grid import grid_m, spacing_m
from ertskin.data.material import Material
from ertskin.data.noise import Evidence
from ertskin.data.shards import request_key
from ertskin.data.skin_forward import SkinForward
from ertskin.data.synthesis import Forward, planned, synthesize
from ertskin.data.touches import Touches, touches_of
from ertskin.data.trials import TrialSet, joined
from ertskin.errors import UserError
from ertskin.hardware.recording import Recording, read_recording
from ertskin.physics.history import History, Phase
from ertskin.progress import counting

Array = NDArray[np.float64]

OWN = 0.25
"""A press belongs to a taxel if it lands within this part of the taxels' spacing."""


def simulated(config: DictConfig) -> Material:
    """Calibrate and synthesize, unless that is done, and add what the recording says of noise and discrepancy.

    The real one-point presses teach the denoiser; for a model without one they correct the trials instead, where
    ``data.discrepancy`` asks for it.
    """
    return material_and_forward(config, read_recording(config.recording))[0]


def material_and_forward(config: DictConfig, recording: Recording) -> tuple[Material, SkinForward]:
    """``simulated`` from a recording already read, and the forward model its trials come from."""
    made = simulated_trials(config, recording)
    forward, checksum = made.forward, made.checksum
    build_noise = hydra.utils.instantiate(config.noise)
    taxel_m, protocol = grid_m(config.grid, forward.calibration.known_sensor), forward.protocol
    if recording.frames is None:
        noise = build_noise(Evidence(protocol))
        return Material(protocol, taxel_m, made.network, noise, checksum, made.denoiser), forward
    touches = touches_of(recording)
    real = correcting(touches)
    changes_ohm = forward.change_ohm(real.history.contact_m, real.history.force_n)
    residual_v = real.readings_v.reshape(-1, *protocol.shape) - protocol.readings(changes_ohm)
    slope_v = rest_slopes_v(protocol, forward.calibration, forward.resolution)
    residual = residual_v if len(real) > 1 else None
    noise = build_noise(Evidence(protocol, touches.rest_v, residual, slope_v, touches.rest_zero))
    pairs = denoiser_pairs(touches_of(recording, rests=True), forward, len(taxel_m))
    material = Material(protocol, taxel_m, made.network, noise, checksum, joined([pairs, made.denoiser]))
    if config.data.discrepancy and config.model.denoiser is None and len(real):
        return _corrected(material, real, changes_ohm), forward
    return material, forward


@dataclass(frozen=True, eq=False)
class SimulatedTrials:
    """Trials for the network and for the denoiser, the forward model they come from, and where they are kept."""

    network: TrialSet
    denoiser: TrialSet
    forward: SkinForward
    checksum: str
    folder: Path


def simulated_trials(config: DictConfig, recording: Recording) -> SimulatedTrials:
    """Calibrate and synthesize, unless that is done."""
    if recording.protocol is None:
        raise UserError(f"{config.recording}: has no /protocol, so its readings can't be simulated")
    plan = planned(config.data.plan)
    if recording.sensor is not None and len(grid_m(config.grid, recording.sensor)) < plan.contacts:
        raise UserError(f"trials of {plan.contacts} contacts need as many taxels: choose a grid, as grid=6x6")
    calibration, checksum = ready_calibration(config, recording)
    taxel_m = grid_m(config.grid, calibration.known_sensor)
    # Presses that land beside their taxels are all at places of their own: nothing to put them together from.
    places_m = taxel_m if plan.jitter_m == 0 else None
    effects = as_builtins(config.effects)
    asked = plan.trials + plan.denoiser_trials
    forward = SkinForward(
        calibration, recording.protocol, effects, config.physics.resolution, places_m, plan.max_force_n, asked
    )
    request = {"calibration": checksum, "effects": forward.effects, "resolution": forward.resolution}
    key = request_key({**request, "plan": asdict(plan), "taxel_m": taxel_m.tolist()})
    folder = Path(config.data.folder) / key
    with counting("synthesizing trials") as progress:
        cluster = hydra.utils.instantiate(config.cluster)
        made = synthesize(folder, request, plan, taxel_m, lambda: forward, cluster, progress)
    network, denoiser, checksum = made
    return SimulatedTrials(network, denoiser, forward, checksum, folder)


def as_builtins(config: DictConfig) -> dict[str, Any]:
    """A config as plain data."""
    return dict(OmegaConf.to_container(config, resolve=True))  # type: ignore[arg-type]


def correcting(touches: Touches) -> Touches:
    """The frames of one-point presses that correct the simulator."""
    single = touches.history.touched.sum(axis=1) == 1
    return touches[np.flatnonzero(single & _as_they_come(touches.history))]


def _as_they_come(history: History) -> NDArray[np.bool_]:
    """(T,) frames of known force in which a touch is read as it comes, before the skin creeps: those in which the force
    rises, or of a press that has none all those held, as of most that are imported."""
    known = np.isfinite(np.where(history.touched, history.force_n, 0.0)).all(axis=1) & history.touched.any(axis=1)
    loading = known & (history.phase == Phase.LOADING)
    held = known & (history.phase == Phase.HOLD)
    return np.asarray(loading | (held & ~np.isin(history.press, history.press[loading])))


def denoiser_pairs(touches: Touches, forward: Forward, taxels: int) -> TrialSet:
    """Measured changes beside simulated ones: touches as they come and the rest before each press, 324 in the paper.

    ``touches`` come with rests. Their force maps stay blank: a denoiser learns readings, no forces.
    """
    real = touches[np.flatnonzero(_as_they_come(touches.history) | (touches.history.phase == Phase.REST))]
    changes_ohm = forward.change_ohm(real.history.contact_m, real.history.force_n)
    blank = np.zeros((len(real), taxels))
    return TrialSet(changes_ohm, blank, real.history.contact_m, real.history.force_n, real.readings_v)


def recorded_discrepancy(material: Material, real: Touches, changes_ohm: Array) -> Discrepancy:
    """What the one-point presses ``real`` show beyond the simulator, which says ``changes_ohm`` (N,P) of them."""
    simulated_v = material.protocol.whitened(changes_ohm)
    residual_v = real.change_v - simulated_v
    place_m, force_n = real.history.contact_m[:, 0], real.history.force_n[:, 0]
    reach_m = OWN * spacing_m(material.taxel_m)
    return Discrepancy.fit(place_m, force_n, simulated_v, residual_v, material.noise.covariance_v2, reach_m)


def _corrected(material: Material, real: Touches, changes_ohm: Array) -> Material:
    """The trials with the discrepancy of the recorded places added."""
    protocol, trials = material.protocol, material.trials
    found = recorded_discrepancy(material, real, changes_ohm)
    residual_v = real.change_v - protocol.whitened(changes_ohm)
    added_ohm = protocol.unwhitened(found.of(trials.contact_m, trials.force_n))
    key = hashlib.sha256(material.checksum.encode() + residual_v.tobytes()).hexdigest()
    return replace(material, trials=replace(trials, change_ohm=trials.change_ohm + added_ohm), checksum=key)
