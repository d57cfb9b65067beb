"""Emulated ERT readers: our own link, an OpenEIT Spectra, an EIT-kit.

Their protocols' sources are named beside the drivers, in ``ertskin.hardware.ert_readers``.
"""

from __future__ import annotations

import json
import re
from collections import deque
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.ert_readers.frame import Flag, Frame, Type, encode, scan_payload
from ertskin.hardware.virtual.terminal import DeviceClock, Terminal
from ertskin.hardware.virtual.world import Array, World

KEPT_SCANS = 4
_REQUEST = re.compile(rb"S (\d{1,10})")


class LinkReader(Terminal):
    """A reader on our own link, over USB: scans when asked, keeps the last four.

    ``made`` holds the counts of the latest scans and ``scans`` their number since the beginning, for whoever checks.
    """

    def __init__(self, clock: DeviceClock, link: Path, world: World) -> None:
        super().__init__(clock, link, bytes_per_s=1e6)
        self.gain = 1.0
        self._world = world
        self._line = bytearray()
        self._kept: deque[tuple[int, bytes]] = deque(maxlen=KEPT_SCANS)
        self._next = 0
        self._flags = int(Flag.FIRST)
        self._started_s = clock.now()
        self.made: deque[NDArray[np.int32]] = deque(maxlen=256)
        self.scans = 0

    def power_on(self) -> None:
        """Start anew: the numbering and the device's clock begin at zero."""
        self._line.clear()
        self._kept.clear()
        self._next = 0
        self._flags = int(Flag.FIRST)
        self._started_s = self.clock.now()

    def receive(self, data: bytes) -> None:
        """Requests end in a line feed."""
        for byte in data:
            if byte == 0x0A:
                request = bytes(self._line)
                self._line.clear()
                self._answer(request)
            elif len(self._line) < 64:
                self._line.append(byte)

    def _answer(self, request: bytes) -> None:
        if request == b"I":
            self._send_text(Type.IDENTITY, json.dumps(self._identity()))
            return
        match = _REQUEST.fullmatch(request)
        if match is None:
            self._send_text(Type.ERROR, "unknown request")
            return
        number = int(match[1])
        kept = dict(self._kept)
        if number == self._next:
            self._scan()
        elif number in kept:
            self.send(kept[number], 0.001)
        else:
            self._send_text(Type.ERROR, f"no scan {number}, the next is {self._next}")

    def _identity(self) -> dict[str, object]:
        protocol = self._world.skin.protocol
        return {
            "name": "virtual ERT reader",
            "serial": "0001",
            "injections": protocol.shape[0],
            "readings": protocol.shape[1],
            "volts_per_count": protocol.adc_volts_per_count,
            "limit_v": protocol.adc_limit_v,
            "scan_s": protocol.scan_s,
            "next": self._next,
        }

    def _send_text(self, kind: Type, text: str) -> None:
        self.send(encode(Frame(kind, 0, 0, self._device_us(), 0, 0, 0, text.encode())), 0.001)

    def _device_us(self) -> int:
        return int(1e6 * (self.clock.now() - self._started_s))

    def _scan(self) -> None:
        protocol = self._world.skin.protocol
        step, limit = protocol.adc_volts_per_count or 1e-4, protocol.adc_limit_v or np.inf
        count = np.round(self.gain * self._world.scan(self.clock.now()) / step)
        saturated = count * step >= limit
        read = np.where(saturated, np.floor(limit / step), count).astype(np.int32)
        flags = self._flags | (int(Flag.SATURATED) if saturated.any() else 0)
        scan_s = protocol.scan_s or 0.4
        payload = scan_payload(read, saturated)
        frame = Frame(Type.SCAN, flags, self._next, self._device_us(), int(1e6 * scan_s), *protocol.shape, payload)
        self._kept.append((self._next, encode(frame)))
        self.made.append(read)
        self.scans += 1
        self._next += 1
        self._flags = 0
        self.send(self._kept[-1][1], scan_s)


class TextReader(Terminal):
    """Scans without end and writes a line for each."""

    def __init__(self, clock: DeviceClock, link: Path, world: World, label: str = "") -> None:
        """``label``: what stands in front of the values."""
        super().__init__(clock, link, bytes_per_s=1e5)
        self._world = world
        self._label = label
        self._period_s = world.skin.protocol.scan_s or 0.4
        self._ends_s = clock.now() + self._period_s
        self._seen: Array | None = None
        self.made: deque[Array] = deque(maxlen=1024)

    def power_on(self) -> None:
        """Start anew."""
        self._seen = None
        self._ends_s = self.clock.now() + self._period_s

    def tick(self) -> None:
        """Send the scan that has ended; begin the next."""
        now = self.clock.now()
        if now < self._ends_s:
            return
        if self._seen is not None:
            self.made.append(self._seen)
            values = ",".join(f"{value:.4f}" for value in self._seen.ravel())
            self.send(f"{self._label}{values}\r\n".encode())
        self._seen = self._world.scan(now)
        self._ends_s = now + self._period_s

    def next_s(self) -> float:
        """The end of the scan under way."""
        return self._ends_s


def spectra_board(clock: DeviceClock, link: Path, world: World) -> TextReader:
    """An OpenEIT Spectra in tomography mode."""
    return TextReader(clock, link, world, "magnitudes : ")


def eit_kit_board(clock: DeviceClock, link: Path, world: World) -> TextReader:
    """An EIT-kit; its skin's protocol must have as many injections as readings."""
    return TextReader(clock, link, world)
