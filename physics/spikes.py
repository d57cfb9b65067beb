"""Readings beyond what the redundancy of the scan allows: found by reciprocity, replaced by what the others say."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physics.protocol import Protocol

Array = NDArray[np.float64]

_MAD_TO_STD = 1.4826


def robust_std(values: Array, axis: int | None = None) -> Array:
    """Standard deviation from the median absolute value of zero-mean ``values``; spikes don't move it."""
    return np.asarray(_MAD_TO_STD * np.median(np.abs(values), axis=axis))


def despiked(
    protocol: Protocol, voltage_v: Array, threshold: float = 5.0, rounds: int = 40
) -> tuple[Array, NDArray[np.bool_]]:
    """Whitened coordinates (T,P) in volt of readings (T,K,M) in volt, and the mask (T,K,M) of readings left out.

    The readings are projected onto what a resistor network could give; a reading further than ``threshold`` robust
    standard deviations from the projection, or NaN, is left out and the projection done again until it stands. The
    largest go first, or what they pull along would be left out too. With many readings behind each number this
    converges in a few rounds while spikes are a few percent.
    """
    basis = protocol.orthonormal
    flat = np.asarray(voltage_v, dtype=float).reshape(len(voltage_v), -1)
    missing = ~np.isfinite(flat)
    spikes = missing.copy()
    filled = np.where(missing, 0.0, flat)
    coordinates = filled @ basis
    active = np.arange(len(flat))
    for _ in range(rounds):
        fit = coordinates[active] @ basis.T
        away = np.abs(filled[active] - fit)
        typical = _typical(away)
        worst = np.where(spikes[active], 0.0, away).max(axis=1)
        limit = np.maximum(threshold * typical, 0.5 * worst)
        spikes[active] = (away > limit[:, None]) | missing[active]
        update = np.stack([_without(basis, filled[t], spikes[t]) for t in active])
        moved = np.abs(update - coordinates[active]).max(axis=1) > 1e-3 * typical
        coordinates[active] = update
        active = active[moved | (worst > threshold * typical)]
        if not len(active):
            break
    return coordinates, spikes.reshape(voltage_v.shape)


def _without(basis: Array, reading: Array, left_out: NDArray[np.bool_]) -> Array:
    """(P,) least-squares coordinates of one frame's readings (R,) without those left out."""
    kept = np.where(left_out, 0.0, reading) @ basis
    lost = basis[left_out]
    if len(lost) > basis.shape[1]:
        return np.asarray(np.linalg.lstsq(np.eye(basis.shape[1]) - lost.T @ lost, kept, rcond=1e-9)[0])
    # The same by Woodbury, in fewer unknowns.
    correction = np.linalg.lstsq(np.eye(len(lost)) - lost @ lost.T, lost @ kept, rcond=1e-9)[0]
    return kept + lost.T @ correction


def _typical(absolute: Array) -> Array:
    """(T,) robust standard deviation of each frame's absolute residuals, kept off zero for noise-free frames."""
    middle = np.median(absolute, axis=1)
    scale = np.finfo(float).eps * 1e3
    return np.maximum(_MAD_TO_STD * middle, scale)
