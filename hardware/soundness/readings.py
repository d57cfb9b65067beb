"""Voltages a passive sheet can give: it takes power up and never gives any out."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.measurement import Frames, Recording
from ertskin.hardware.plausibility import Doubt
from ertskin.physics.history import Phase
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]

FIELD = "/frames/voltage_v"
TYPICAL_FRAMES = 25
"""So many frames make the typical scan."""
ALIKE = 0.2
"""Injections alike must read alike, up to this part of their size."""


def reading_faults(recording: Recording) -> Iterator[Doubt]:
    """What is wrong with the voltages; readings that no protocol explains are only asked to change."""
    frames, protocol = recording.frames, recording.protocol
    assert frames is not None
    if not frames.voltage_v.size:
        return
    idle = list(_idle_faults(frames))
    yield from idle
    if protocol is None or idle:
        return
    scan_v = typical_scan(frames)
    swapped = list(_swapped_faults(scan_v, protocol))
    yield from swapped or _sign_faults(scan_v, protocol)
    yield from _repeated_faults(scan_v, protocol)


def typical_scan(frames: Frames) -> Array:
    """(K,M) median of the first rest frames, of the first frames where none is at rest; NaN where unknown."""
    rest = np.flatnonzero(frames.history.phase == Phase.REST)
    rows = (rest if len(rest) else np.arange(len(frames)))[:TYPICAL_FRAMES]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # Of readings that are never taken.
        return np.asarray(np.nanmedian(frames.voltage_v[rows].astype(float), axis=0))


def _idle_faults(frames: Frames) -> Iterator[Doubt]:
    voltage = frames.voltage_v
    first = voltage[np.isfinite(voltage)][:1]
    if not len(first):
        yield Doubt(FIELD, "no reading that is a number", "volts")
    elif voltage.shape[1] * voltage.shape[2] > 1 and not (np.isfinite(voltage) & (voltage != first[0])).any():
        yield Doubt(FIELD, f"{first[0]:g} V in every reading", "readings of the skin")
    elif (
        len(frames) > 2
        and np.array_equal(voltage[0], voltage[-1], equal_nan=True)
        and frames.history.touched.any()
        and np.array_equal(voltage, np.broadcast_to(voltage[0], voltage.shape), equal_nan=True)
    ):
        yield Doubt(FIELD, "the same readings in every frame, pressed or not", "readings of the skin")


def _sign_faults(scan_v: Array, protocol: Protocol) -> Iterator[Doubt]:
    """Instruments that read no driven electrode often give sizes without a sign: nothing is asked of these."""
    power_w = injected_power_w(scan_v, protocol)
    known = np.isfinite(power_w)
    if not known.any():
        return
    expected = "power that goes into the skin: check the signs of voltages and currents"
    negative = known & (power_w < -0.1 * float(np.median(np.abs(power_w[known]))))
    if negative.sum() > 0.5 * known.sum():
        found = f"power coming out of the skin in {int(negative.sum())} of {int(known.sum())} injections"
        yield Doubt(FIELD, found, expected)


def injected_power_w(scan_v: Array, protocol: Protocol) -> Array:
    """(K,) power into the skin in each injection of a scan (K,M) in watt, NaN where its readings can't tell.

    That is the injected currents times their electrodes' potentials, wherever the readings span that sum.
    """
    known = np.isfinite(scan_v)
    weight = np.where(known[..., None], protocol.measurement, 0.0).transpose(0, 2, 1)
    current = protocol.injection_current_a
    share = np.linalg.pinv(weight, rcond=1e-6) @ current[:, :, None]
    left = current - (weight @ share)[..., 0]
    determined = np.linalg.norm(left, axis=1) < 1e-6 * np.linalg.norm(current, axis=1)
    return np.where(determined, (share[..., 0] * np.where(known, scan_v, 0.0)).sum(axis=1), np.nan)


def _swapped_faults(scan_v: Array, protocol: Protocol) -> Iterator[Doubt]:
    """Where every potential is read against the sink, the sink reads nothing; swapped, the source does."""
    if protocol.pairs is None or scan_v.shape[1] != protocol.electrodes:
        return
    size = np.abs(scan_v)
    source, sink = (size[np.arange(len(size)), column] for column in protocol.pairs.T)
    itself = ~protocol.measurement[np.arange(len(size)), protocol.pairs[:, 1]].any(axis=1)
    largest = np.max(np.where(np.isfinite(size), size, 0.0), axis=1)
    swapped = np.flatnonzero(itself & (source < 0.05 * sink) & (sink > 0.5 * largest))
    if len(swapped):
        a, b = protocol.pairs[swapped[0]]
        found = f"{len(swapped)} injections with source and sink swapped, first {swapped[0]}, from {a} to {b}"
        yield Doubt("/protocol/injection", found, "the sink second: against itself it reads nothing")


def _repeated_faults(scan_v: Array, protocol: Protocol) -> Iterator[Doubt]:
    """Injections of the same currents, read the same way, whose readings are not the same."""
    seen: dict[bytes, int] = {}
    for k, (current, weight) in enumerate(zip(protocol.injection_current_a, protocol.measurement, strict=True)):
        first = seen.setdefault(current.tobytes() + weight.tobytes(), k)
        both = np.nan_to_num(scan_v[[first, k]])
        if np.linalg.norm(both[1] - both[0]) > ALIKE * np.linalg.norm(both):
            found = f"injections {first} and {k} alike, with readings that are not"
            yield Doubt("/protocol/injection", found, "injections as they were made")
            return
