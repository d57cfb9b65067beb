"""Where live scans come from: a reader on a rig, or a recording played again."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.failure import InstrumentError
from ertskin.hardware.instrument import ErtReader, Scan
from ertskin.hardware.recording import Frames
from ertskin.physics.history import Phase
from ertskin.physics.protocol import Protocol
from ertskin.physics.spikes import completed

RETRY_S = 1.0


def scans_of_reader(
    reader: ErtReader, protocol: Protocol, tell: Callable[[str], None], ending: threading.Event
) -> Iterator[Scan]:
    """Scans of a reader until told to end; one that fails is told of and tried again."""
    reader.identify()
    lost = 0
    while not ending.is_set():
        try:
            reader.start()
            scan = reader.finish((protocol.scan_s or 0.5) + 4.0)
            lost += scan.lost
            if (voltage := _whole(protocol, scan.voltage_v)) is None:
                lost += 1
                continue
            yield replace(scan, voltage_v=voltage, lost=lost)
            lost = 0
        except InstrumentError as error:
            tell(str(error))
            ending.wait(RETRY_S)
            try:
                reader.restore()
            except InstrumentError as again:
                tell(str(again))


def scans_of_recording(frames: Frames, protocol: Protocol, speed: float, ending: threading.Event) -> Iterator[Scan]:
    """A recording's scans from its first rest frame on, ``speed`` times as fast as taken; 0 without waiting."""
    rest = np.flatnonzero(frames.history.phase == Phase.REST)
    first = int(rest[0]) if len(rest) else 0
    times = frames.history.time_s
    begin, lost = time.monotonic(), 0
    for number in range(first, len(frames)):
        due = begin + (times[number] - times[first]) / speed if speed > 0 else begin
        if ending.wait(max(0.0, due - time.monotonic())):
            return
        if (voltage := _whole(protocol, frames.voltage_v[number])) is None:
            lost += 1
            continue
        saturated = None if protocol.adc_limit_v is None else voltage >= protocol.adc_limit_v
        yield Scan(float(times[number]), voltage, saturated=saturated, sequence=number, lost=lost)
        lost = 0


def _whole(protocol: Protocol, voltage_v: NDArray[np.float32]) -> NDArray[np.float32] | None:
    """A scan (K,M) for a network: lost readings by the others, nought where none is taken; None if too much is."""
    voltage = completed(protocol, voltage_v[None].astype(float))[0].astype(np.float32)
    return voltage if np.isfinite(voltage).all() else None
