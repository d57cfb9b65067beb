"""Readings beyond what the redundancy of the scan allows: found by reciprocity, replaced by what the others say."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]

_MAD_TO_STD = 1.4826

LEAST_HELD = 1e-6
"""Share of every combination of pair resistances that the readings there are must hold."""


def robust_std(values: Array, axis: int | None = None) -> Array:
    """Standard deviation from the median absolute value of zero-mean ``values``; spikes don't move it."""
    return np.asarray(_MAD_TO_STD * np.median(np.abs(values), axis=axis))


def noise_on_course(values: Array) -> float:
    """Standard deviation of the noise of ``values`` (N,) on a smooth course, from third differences, in their unit.

    1e-4 at least: a tenth of a millinewton, or a ten-thousandth where values are logarithms.
    """
    return float(max(robust_std(np.diff(values, 3)) / np.sqrt(20.0), 1e-4))


def despiked(
    protocol: Protocol, voltage_v: Array, threshold: float = 5.0, rounds: int = 40
) -> tuple[Array, NDArray[np.bool_]]:
    """Whitened coordinates (T,n) in volt of readings (T,K,M) in volt, and the mask (T,K,M) of readings left out.

    The readings are projected onto what a resistor network could give; a reading further than ``threshold`` robust
    standard deviations from the projection, or NaN, is left out and the projection done again until it stands. The
    largest go first, or what they pull along would be left out too. With many readings behind each number this
    converges in a few rounds while spikes are a few percent. Where a number has only two readings behind it, they are
    off alike, and the one further from its median over the frames is left out.
    """
    basis = protocol.orthonormal
    flat = np.asarray(voltage_v, dtype=float).reshape(len(voltage_v), -1)
    missing = ~(np.isfinite(flat) & protocol.taken.ravel())
    spikes = missing.copy()
    filled = np.where(missing, 0.0, flat)
    coordinates = filled @ basis
    active = np.arange(len(flat))
    for _ in range(rounds):
        fit = coordinates[active] @ basis.T
        away = np.abs(filled[active] - fit)
        typical = _typical(away, missing[active])
        worst = np.where(spikes[active], 0.0, away).max(axis=1)
        limit = np.maximum(threshold * typical, 0.5 * worst)
        spikes[active] = (away > limit[:, None]) | missing[active]
        for t in active[[not tells_all(basis, spikes[t]) for t in active]]:
            spikes[t] = _replaceable(basis, spikes[t], missing[t], np.abs(flat[t] - _medians(flat, missing)))
        update = np.stack([_without(basis, filled[t], spikes[t]) for t in active])
        moved = np.abs(update - coordinates[active]).max(axis=1) > 1e-3 * typical
        coordinates[active] = update
        active = active[moved | (worst > threshold * typical)]
        if not len(active):
            break
    return coordinates, spikes.reshape(voltage_v.shape)


def completed(protocol: Protocol, voltage_v: Array) -> Array:
    """Readings (T,K,M) in volt with those lost replaced by what the others say, nought where none is taken.

    NaN stays in a frame that has lost more than the others can tell.
    """
    voltage = protocol.filled(voltage_v)
    lost = ~np.isfinite(voltage)
    for frame in np.flatnonzero(lost.any(axis=(1, 2))):
        gone, reading = lost[frame].ravel(), np.where(lost[frame], 0.0, voltage[frame]).ravel()
        if tells_all(protocol.orthonormal, gone):
            fit = protocol.orthonormal @ _without(protocol.orthonormal, reading, gone)
            voltage[frame] = np.where(gone, fit, reading).reshape(protocol.shape)
    return voltage


def _without(basis: Array, reading: Array, left_out: NDArray[np.bool_]) -> Array:
    """(P,) least-squares coordinates of one frame's readings (R,) without those left out."""
    kept = np.where(left_out, 0.0, reading) @ basis
    lost = basis[left_out]
    if len(lost) > basis.shape[1]:
        return np.asarray(np.linalg.lstsq(np.eye(basis.shape[1]) - lost.T @ lost, kept, rcond=1e-9)[0])
    # The same by Woodbury, in fewer unknowns.
    correction = np.linalg.lstsq(np.eye(len(lost)) - lost @ lost.T, lost @ kept, rcond=1e-9)[0]
    return kept + lost.T @ correction


def _medians(flat: Array, missing: NDArray[np.bool_]) -> Array:
    """(R,) median of each reading over the frames that have it, nought where none has."""
    present = ~missing.all(axis=0)
    usual = np.zeros(flat.shape[1])
    usual[present] = np.nanmedian(np.where(missing, np.nan, flat)[:, present], axis=0)
    return usual


def tells_all(basis: Array, gone: NDArray[np.bool_]) -> bool:
    """Whether the readings (R,) that are not ``gone`` tell all coordinates in an orthonormal ``basis`` (R,n)."""
    rows = basis[gone]
    rows = rows[rows.any(axis=1)]
    if (rows**2).sum() < 1 - LEAST_HELD:
        return True
    small = rows @ rows.T if len(rows) < rows.shape[1] else rows.T @ rows
    return 1 - float(np.linalg.eigvalsh(small)[-1]) > LEAST_HELD


def _replaceable(
    basis: Array, spikes: NDArray[np.bool_], missing: NDArray[np.bool_], unusual: Array
) -> NDArray[np.bool_]:
    """Of ``spikes`` (R,), the most ``unusual`` first, those that the readings that stay can stand in for."""
    kept = missing.copy()
    doubtful = np.flatnonzero(spikes & ~missing)
    for reading in doubtful[np.argsort(-unusual[doubtful], kind="stable")]:
        kept[reading] = True
        kept[reading] = tells_all(basis, kept)
    return kept


def _typical(absolute: Array, missing: NDArray[np.bool_]) -> Array:
    """(T,) robust standard deviation of each frame's absolute residuals, kept off zero for noise-free frames."""
    rows = zip(absolute, ~missing, strict=True)
    middle = np.array([np.median(row[present]) if present.any() else 0.0 for row, present in rows])
    scale = np.finfo(float).eps * 1e3
    return np.maximum(_MAD_TO_STD * middle, scale)
