"""The resting skin's mean scan, with a few wild samples bent down."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.calibration.scan_space import ScanSpace
from ertskin.physics.protocol import Protocol
from ertskin.physics.spikes import completed

Array = NDArray[np.float64]

_BEND = 5.0
"""Samples further than this many robust sigmas from their median are moved to that distance."""


@dataclass(frozen=True, eq=False)
class RestScan:
    """Mean readings (K,M) in volt over ``frames`` rest frames.

    ``noise_v``: one reading's noise in one frame, from the scatter of the part that no resistor network could give, so
    that nothing which happens to the skin counts as noise. ``scatter_v``: the scatter of whole frames in ``ScanSpace``
    coordinates; the same where frames differ by noise alone, more where the skin drifts or presses leave something
    behind. Both robust, NaN with a single frame. ``nonreciprocal_v``: rms per reading of the mean's part that no
    resistor network could give; ``noise_v / sqrt(frames)`` on a sound instrument.
    """

    voltage_v: Array
    frames: int
    noise_v: float
    scatter_v: float
    nonreciprocal_v: float


def rest_scan(voltage_v: Array, protocol: Protocol) -> RestScan:
    """Robust mean of rest frames (T,K,M) in volt: each reading's samples are winsorised about their median.

    Readings lost are taken from the others; frames that have lost too much are left out. Raises ``ValueError`` if none
    remains.
    """
    voltage = completed(protocol, np.asarray(voltage_v, dtype=float))
    voltage = voltage[np.isfinite(voltage).all(axis=(1, 2))]
    if not len(voltage):
        raise ValueError("no complete rest frame to calibrate on")
    middle = np.median(voltage, axis=0)
    spread = 1.4826 * np.median(np.abs(voltage - middle), axis=0)
    bent = np.clip(voltage, middle - _BEND * spread, middle + _BEND * spread) if len(voltage) > 2 else voltage
    mean = bent.mean(axis=0)
    space = ScanSpace.of(protocol)
    seen = space.coordinates(bent - mean)
    unseen = (bent - mean).reshape(len(voltage), -1) - seen @ space.basis.T
    rest = mean.ravel() - space.basis @ space.coordinates(mean)
    enough = np.sqrt(len(voltage) / (len(voltage) - 1)) if len(voltage) > 1 else np.nan
    share = np.sqrt(protocol.count / max(1, protocol.count - space.basis.shape[1]))
    return RestScan(
        mean,
        len(voltage),
        _robust_scale(unseen[:, protocol.taken.ravel()]) * share * enough,
        _robust_scale(seen) * enough,
        float(np.sqrt((rest**2).sum() / protocol.count)) * share,
    )


def _robust_scale(values: Array) -> float:
    return float(1.4826 * np.median(np.abs(values)))
