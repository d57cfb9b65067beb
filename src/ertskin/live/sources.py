"""Where live scans come from: a reader on a rig, or a recording played again."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

import numpy as np

from hardware.failure import InstrumentError
from hardware.instrument import ErtReader, Scan
from hardware.recording import Frames
from physics.history import Phase
from physics.protocol import Protocol

RETRY_S = 1.0


def scans_of_reader(
    reader: ErtReader, protocol: Protocol, tell: Callable[[str], None], ending: threading.Event
) -> Iterator[Scan]:
    """Scans of a reader until told to end; one that fails is told of and tried again."""
    reader.identify()
    while not ending.is_set():
        try:
            reader.start()
            yield reader.finish((protocol.scan_s or 0.5) + 4.0)
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
    begin = time.monotonic()
    for number in range(first, len(frames)):
        due = begin + (times[number] - times[first]) / speed if speed > 0 else begin
        if ending.wait(max(0.0, due - time.monotonic())):
            return
        voltage = frames.voltage_v[number]
        saturated = None if protocol.adc_limit_v is None else voltage >= protocol.adc_limit_v
        yield Scan(float(times[number]), voltage, saturated=saturated, sequence=number)
