"""A clock that jumps over the waiting: an hour on the virtual bench passes as fast as it can be computed."""

from __future__ import annotations

import os
import select
import time
from typing import Protocol

from ertskin.hardware.clock import Readable, unheard

STUCK_S = 2.0
"""Real seconds after which bytes under way count as lost."""


class Device(Protocol):
    """What the clock must know of an emulated device: its line's two names and the bytes that went over it."""

    port: str
    terminal: str
    taken: int
    put: int

    def pump(self) -> None:
        """Do what is due by now."""
        ...

    def due_s(self) -> float:
        """When the device will next do something by itself; infinity for never."""
        ...


class VirtualClock:
    """Seconds since the bench was switched on, passing only while the host waits.

    One thread runs host and devices: a wait lets the devices work, and when none has anything left to do before a later
    time, the clock jumps there. The kernel carries bytes between the two ends of a pseudo-terminal in its own time; the
    count of bytes on either side tells when all have arrived. So a run depends on its seed alone.
    """

    def __init__(self, start_s: float = 0.0) -> None:
        self.sign_of_life = unheard
        self._now_s = start_s
        self._devices: list[Device] = []
        self._wrote: dict[str, int] = {}
        self._read: dict[str, int] = {}

    def attach(self, device: Device) -> None:
        """Let a device take part."""
        self._devices.append(device)

    def renew(self, port: str) -> None:
        """A line was plugged in anew: count its bytes from zero."""
        self._wrote[port] = self._read[port] = 0

    def now(self) -> float:
        """Seconds."""
        self.sign_of_life()
        return self._now_s

    def sleep(self, seconds: float) -> None:
        """Let so many seconds pass."""
        self._wait(None, seconds)

    def wait_readable(self, port: Readable, timeout_s: float) -> bool:
        """Wait until the port can be read."""
        return self._wait(port.fileno(), timeout_s)

    def opened(self, port: str) -> None:
        """The host opened a line, which throws away what was on it."""
        for device in self._devices:
            if device.port == port:
                self._wrote[port], self._read[port] = device.taken, device.put

    def wrote(self, port: str, count: int) -> None:
        """The host put ``count`` bytes on a line."""
        self._wrote[port] = self._wrote.get(port, 0) + count

    def read(self, port: str, count: int) -> None:
        """The host took ``count`` bytes off a line."""
        self._read[port] = self._read.get(port, 0) + count

    def _wait(self, descriptor: int | None, seconds: float) -> bool:
        deadline = self._now_s + max(0.0, seconds)
        awaited = None if descriptor is None else os.ttyname(descriptor)
        stuck = time.monotonic() + STUCK_S
        while True:
            for device in self._devices:
                device.pump()
            if descriptor is not None and select.select([descriptor], [], [], 0)[0]:
                return True
            if self._under_way(awaited):
                if time.monotonic() < stuck:
                    time.sleep(2e-5)
                    continue
                self._forget_lost()
            if self._now_s >= deadline:
                return False
            self._now_s = min([deadline, *(max(device.due_s(), self._now_s) for device in self._devices)])
            stuck = time.monotonic() + STUCK_S

    def _under_way(self, awaited: str | None) -> bool:
        """Whether bytes of the host, or of the device it waits for, have not arrived yet."""
        for device in self._devices:
            if self._wrote.get(device.port, 0) > device.taken:
                return True
            if device.terminal == awaited and device.put > self._read.get(device.port, 0):
                return True
        return False

    def _forget_lost(self) -> None:
        """Bytes that never arrived never will."""
        for device in self._devices:
            self.opened(device.port)
