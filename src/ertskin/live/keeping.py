"""A recording of what is seen live: scans with their times; who touched, where and how hard is not known."""

from __future__ import annotations

import threading
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from ertskin.hardware.instrument import Scan
from ertskin.hardware.plan import Plan
from ertskin.hardware.recorder import FrameEntry, Recorder
from ertskin.hardware.recording import Recording
from ertskin.live.session import LiveFrame
from ertskin.physics.history import Phase
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor


class Keeper:
    """Starts and ends recordings while the skin is watched."""

    def __init__(self, folder: Path, rig: str, sensor: Sensor | None, protocol: Protocol) -> None:
        self._folder, self._rig, self._sensor, self._protocol = folder, rig, sensor, protocol
        self._recorder: Recorder | None = None
        # The page turns it on and off from a thread of its own.
        self._lock = threading.Lock()

    @property
    def frames(self) -> int | None:
        """Frames recorded so far, None while nothing is."""
        recorder = self._recorder
        return None if recorder is None else recorder.frames

    def turn(self) -> str:
        """Begin a recording, or end the one that runs; what was done, in words."""
        if self._recorder is not None:
            return self.end()
        now = datetime.now(UTC)
        path = self._folder / f"live-{now:%Y%m%dT%H%M%SZ}.h5"
        header = Recording(self._rig, f"{now:%Y-%m-%dT%H:%M:%SZ}", "seen live", self._sensor, self._protocol)
        with self._lock:
            self._recorder = Recorder(path, header, Plan("live", ()), self._protocol.shape, counts=False)
        return f"recording to {path}"

    def end(self) -> str:
        """End the recording that runs, if one does."""
        with self._lock:
            recorder, self._recorder = self._recorder, None
        if recorder is None:
            return "nothing is being recorded"
        recorder.finish()
        return f"recorded {recorder.frames} frames to {recorder.path}"

    def keep(self, scan: Scan, frame: LiveFrame) -> None:
        """Add a scan to the recording that runs: as touched where the network says so."""
        phase = Phase.HOLD if frame.contacts else Phase.REST
        unknown = np.full(1, np.nan)
        entry = FrameEntry(scan.voltage_v, None, scan.time_s, 0, phase, np.full((1, 2), np.nan), unknown, unknown)
        with self._lock:
            if self._recorder is not None:
                self._recorder.append(entry)
