"""What a recording says, reduced for diagnosis: whitened scans, what no resistor network explains, forces, noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hardware.recording import Recording
from physics.history import History, Phase
from physics.protocol import Protocol
from physics.sensor import Sensor
from physics.spikes import despiked, robust_std

Array = NDArray[np.float64]


class CannotTell(Exception):
    """The recording can't answer the question; the message says why."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """T frames reduced.

    ``scan_v`` (T,P) whitened scans, spikes left out; ``leftover_v`` (T,K,M) what no resistor network gives, zero at
    spikes; ``spike`` (T,K,M); ``noise_v`` white noise of a reading; ``air_n`` noise of the load cell.
    """

    sensor: Sensor
    protocol: Protocol
    history: History
    scan_v: Array
    leftover_v: NDArray[np.float32]
    spike_fraction: float
    noise_v: float
    air_n: float
    saturated_v: float | None

    @property
    def rest(self) -> NDArray[np.bool_]:
        """(T,) frames in which nothing touches."""
        return np.asarray(self.history.phase == Phase.REST)


def gather(recording: Recording) -> Evidence:
    """Reduce a recording; raises ``CannotTell`` where it lacks what any answer needs."""
    if recording.frames is None or recording.sensor is None or recording.protocol is None:
        raise CannotTell("no frames with a sensor and a protocol: nothing to compare a skin's simulator with")
    history, protocol = recording.frames.history, recording.protocol
    voltage = np.asarray(recording.frames.voltage_v, dtype=float)
    if not np.isfinite(voltage).any():
        raise CannotTell("no reading is a number")
    rest = history.phase == Phase.REST
    if not rest.any():
        raise CannotTell("no rest frames: neither the noise nor the unloaded skin is known")
    whole = np.isfinite(voltage).reshape(len(voltage), -1).mean(axis=1) > 0.5
    if not whole[rest].any():
        raise CannotTell("every rest frame is damaged")
    limit = _saturation(voltage, protocol)
    if limit is not None:
        pinned = np.abs(voltage - limit) < 1e-9 + 2 * (protocol.adc_volts_per_count or 0.0)
        if pinned.mean() > 0.5:
            raise CannotTell(f"{pinned.mean():.0%} of the readings sit at {limit:.4g} V: the converter is saturated")
        voltage[pinned] = np.nan
    try:
        scan, spike = despiked(protocol, voltage)
    except np.linalg.LinAlgError:
        raise CannotTell("this scan can't tell all pair resistances apart") from None
    fitted = (scan @ protocol.orthonormal.T).reshape(voltage.shape)
    leftover = np.where(spike | ~np.isfinite(voltage), 0.0, voltage - fitted)
    readings, pairs = protocol.orthonormal.shape
    core = float(robust_std(leftover[~spike])) * np.sqrt(readings / max(1, readings - pairs))
    quantum = (protocol.adc_volts_per_count or 0.0) / np.sqrt(12)
    if not core > 0:
        raise CannotTell("the readings don't vary: no noise to measure a misfit against")
    force = history.force_n[rest]
    air = float(np.nanstd(force)) if np.isfinite(force).sum() > 3 else float("nan")
    missing = spike.mean(axis=(1, 2)) < 0.5
    scan[~missing] = np.nan
    return Evidence(
        recording.sensor,
        protocol,
        history,
        scan,
        leftover.astype(np.float32),
        float(spike.mean()),
        max(core, quantum),
        air,
        limit,
    )


def _saturation(voltage_v: Array, protocol: Protocol) -> float | None:
    """The value at which readings pile up at the top of their range, if they do."""
    finite = voltage_v[np.isfinite(voltage_v)]
    top = float(finite.max())
    step = protocol.adc_volts_per_count or 1e-9
    piled = int((finite > top - 0.5 * step).sum())
    below = int(((finite <= top - 0.5 * step) & (finite > top - 50 * step)).sum())
    return top if piled > 20 and piled > 3 * max(below, 1) else None
