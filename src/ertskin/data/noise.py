"""A noise model for training, made from what the recording at hand shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.errors import UserError
from ertskin.physics.noise import GaussianNoise, MeasuredNoise, Noise, NoNoise, WhiteNoise
from ertskin.physics.protocol import Protocol
from ertskin.settings import check_limits

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Evidence:
    """What noise can be modelled from: ``rest_v`` (T,K,M) rest frames and ``rest_zero`` (T,T), weights of the others in
    the zero of each, ``residual_v`` (N,K,M) real one-point changes minus simulated ones, either None where the
    recording has none; ``slope_v`` (P,m): by what is known to wander."""

    protocol: Protocol
    rest_v: Array | None = None
    residual_v: Array | None = None
    slope_v: Array | None = None
    rest_zero: Array | None = None


def none(evidence: Evidence) -> Noise:
    """Clean readings."""
    return NoNoise(evidence.protocol)


def white(evidence: Evidence, std_v: float | None = None) -> Noise:
    """Independent readings with ``std_v`` volt each; measured on the rest frames where it isn't given."""
    if std_v is None:
        std_v = measured(evidence).std_v
    if isinstance(std_v, bool) or not isinstance(std_v, (int, float)):
        raise UserError(f"noise.std_v must be a number, not {std_v!r}")
    check_limits(float(std_v), {"least": 0}, "noise.std_v")
    return WhiteNoise(evidence.protocol, std_v)


def gaussian(evidence: Evidence) -> Noise:
    """The paper's: moments of every reading's residual over the real one-point trials."""
    if evidence.residual_v is None:
        raise UserError("noise=gaussian needs real one-point trials, the recording has none; try noise=white")
    return GaussianNoise.from_residuals(evidence.protocol, evidence.residual_v)


def measured(evidence: Evidence) -> MeasuredNoise:
    """White noise, drift with its full covariance, and spikes, as the rest frames show them."""
    if evidence.rest_v is None:
        raise UserError("noise is measured on rest frames, the recording has none; try noise=white noise.std_v=0.002")
    try:
        return MeasuredNoise.from_rest(evidence.protocol, evidence.rest_v, evidence.slope_v, evidence.rest_zero)
    except ValueError as error:
        raise UserError(f"{error}; try noise=white noise.std_v=0.002") from None
