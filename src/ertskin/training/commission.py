"""After training: what the skin looks like at rest, and how unlike trained frames may look before it is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from omegaconf import DictConfig

from ertskin.calibration.ready import ready_calibration
from ertskin.calibration.rest_slopes import rest_slopes_v
from ertskin.calibration.result import Calibration
from ertskin.data.material import Material
from ertskin.data.touch_model import TouchModel
from ertskin.data.touches import Touches, touches_of
from ertskin.hardware.recording import Recording, read_recording
from ertskin.models.contacts import ContactsNetwork
from ertskin.models.monitor import SkinMonitor
from ertskin.models.network import Network
from ertskin.models.novelty import Novelty, limits_of, unexplained_of
from ertskin.physics.calibration.following import FEWEST, RestingSkin
from ertskin.physics.history import Phase
from ertskin.physics.noise.measured import MeasuredNoise
from ertskin.physics.protocol import Protocol
from ertskin.physics.spikes import despiked
from ertskin.training.validation import Validation

Array = NDArray[np.float64]

FITTED = 4000
"""Trials the directions of novelty are taken from."""
NOISIER = 1.1
"""An instrument may be this much noisier on another day: thousands of readings tell far smaller differences."""


def commissioned(
    config: DictConfig, network: Network, material: Material, validation: Validation
) -> SkinMonitor | None:
    """The monitor of a network trained on ``config.recording``; None where that has too few rest frames to tell."""
    if config.recording is None:
        return None
    recording = read_recording(config.recording)
    if recording.frames is None or (recording.frames.history.phase == Phase.REST).sum() < FEWEST:
        return None
    touches = touches_of(recording)
    noise_v = MeasuredNoise.from_rest(material.protocol, touches.rest_v).std_v
    calibration, _ = ready_calibration(config, recording)
    resting = resting_skin(recording, material.protocol, calibration, noise_v, config.physics.resolution)
    return SkinMonitor(resting, _novelty(network, material, validation, touches, noise_v))


def resting_skin(
    recording: Recording, protocol: Protocol, calibration: Calibration, noise_v: float, resolution: str
) -> RestingSkin:
    """How the recording's rest frames wander, by the derivatives of its calibration."""
    assert recording.frames is not None
    history = recording.frames.history
    rest = history.phase == Phase.REST
    rest_v, _ = despiked(protocol, np.asarray(recording.frames.voltage_v[rest], dtype=float))
    whole = np.isfinite(rest_v).all(axis=1)
    slope_v = rest_slopes_v(protocol, calibration, resolution)
    return RestingSkin.learned(rest_v[whole], history.time_s[rest][whole], slope_v, noise_v)


def _novelty(network: Network, material: Material, validation: Validation, touches: Touches, noise_v: float) -> Novelty:
    protocol = material.protocol
    some = material.trials[:: max(1, len(material.trials) // FITTED)]
    novelty = Novelty.of_trials(some.coordinates_v(protocol), material.noise.covariance_v2, touches.change_v, noise_v)
    flat = np.asarray(touches.readings_v, dtype=float)
    leftover = flat - (flat @ protocol.orthonormal) @ protocol.orthonormal.T
    spare = protocol.count - protocol.orthonormal.shape[1]
    unexplained = unexplained_of(leftover, noise_v, spare, len(touches.rest_v))
    recorded = novelty.parts(touches.change_v, None, unexplained).T
    simulated = novelty.parts(validation.change_v, None, None).T
    within = [simulated[0], recorded[0]]
    if isinstance(network, ContactsNetwork):
        within = _misfits(network, material.trials.touch, validation)
    limits = limits_of(within, [simulated[1], recorded[1]], [recorded[2]])
    limits[2] *= NOISIER**2
    return replace(novelty, limits=limits)


def _misfits(network: ContactsNetwork, model: TouchModel | None, validation: Validation) -> list[Array]:
    """Of simulated trials, from where they truly are: a search that goes astray is no strange skin. And of recorded
    presses, each by a response corrected without its place, for the one at hand knows it."""
    assert model is not None
    true = np.concatenate([validation.contact_m, validation.force_n[..., None]], axis=2)
    matrix, posterior = network.trunk.whiten.matrix.double().numpy(), network.posterior
    simulated = posterior.of(validation.change_v @ matrix, true[:, : posterior.most]).misfit
    return [simulated, posterior.of(model.unseen_v @ matrix).misfit]
