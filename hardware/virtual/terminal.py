"""An emulated device at the far end of a pseudo-terminal: to a driver, a serial port like any other."""

from __future__ import annotations

import contextlib
import heapq
import os
import pty
import tty
from pathlib import Path
from typing import Protocol

from ertskin.hardware.virtual.faults import Faults

BACKLOG = 1 << 17
"""Bytes kept for a host that does not read; the rest is lost, as on a real line."""


class DeviceClock(Protocol):
    """The clock as devices see it."""

    def now(self) -> float:
        """Seconds."""
        ...

    def renew(self, port: str) -> None:
        """Told when a line was plugged in anew."""
        ...


class Terminal:
    """A device: bytes in by ``receive``, bytes out by ``send``, its own doings by ``tick``."""

    def __init__(self, clock: DeviceClock, link: Path, bytes_per_s: float = 11_520.0) -> None:
        """``link`` is the port's name for the host. ``bytes_per_s``: 11520 is 115200 baud."""
        self.port = str(link)
        self.clock = clock
        self.incoming = Faults()
        self.outgoing = Faults()
        self.taken = self.put = 0
        self.terminal = ""
        self._bytes_per_s = bytes_per_s
        self._master = self._slave = -1
        self._back_s = 0.0
        self._outbox: list[tuple[float, int, bytes]] = []
        self._number = 0
        self._waiting = b""
        self._free_s = 0.0
        self._only_until_s = -float("inf")
        self._only = b""
        self._plug_in()

    # ------------------------------------------------------------------------------------------ what a device does

    def receive(self, data: bytes) -> None:
        """Take bytes of the host."""

    def tick(self) -> None:
        """Do what is due by now."""

    def next_s(self) -> float:
        """When ``tick`` has something to do next; infinity for never."""
        return float("inf")

    def power_on(self) -> None:
        """Start anew: the line was plugged in."""

    def crash(self) -> None:
        """Reset by itself."""
        self.power_on()

    # --------------------------------------------------------------------------------------- what happens to the line

    def send(self, data: bytes, after_s: float = 0.0) -> None:
        """Put one message on the line, ``after_s`` from now at the earliest; it takes its time to go over."""
        delay_s, data = self.outgoing.suffered(data)
        start_s = max(self.clock.now() + after_s, self._free_s)
        self._free_s = start_s + len(data) / self._bytes_per_s
        self._number += 1
        heapq.heappush(self._outbox, (self._free_s + delay_s, self._number, data))

    def unplug(self, seconds: float = float("inf")) -> None:
        """Pull the cable; it is back after so many seconds."""
        self._outbox.clear()
        self._waiting = b""
        for descriptor in (self._master, self._slave):
            if descriptor >= 0:
                os.close(descriptor)
        self._master = self._slave = -1
        self.terminal = ""
        with contextlib.suppress(FileNotFoundError):
            os.unlink(self.port)
        self.taken = self.put = 0
        self.clock.renew(self.port)
        self._back_s = self.clock.now() + seconds

    def only_say(self, words: bytes, seconds: float) -> None:
        """Answer whatever comes with ``words``, heeding nothing, for so many seconds; without words be deaf."""
        self._only, self._only_until_s = words, self.clock.now() + seconds

    @property
    def plugged(self) -> bool:
        """Whether the cable is in."""
        return self._master >= 0

    @property
    def descriptor(self) -> int:
        """The device's end of the line; negative while unplugged."""
        return self._master

    def close(self) -> None:
        """Take the device away for good."""
        self.unplug()

    def due_s(self) -> float:
        """When the device will next do something by itself."""
        if not self.plugged:
            return self._back_s
        return min(self.next_s(), self._outbox[0][0] if self._outbox else float("inf"))

    def pump(self) -> None:
        """Take what has arrived, do what is due, send what can go."""
        if not self.plugged:
            if self.clock.now() < self._back_s:
                return
            self._plug_in()
            self.power_on()
        data = self._take()
        if data:
            delay_s, data = self.incoming.suffered(data)
            del delay_s
            if data and self.clock.now() < self._only_until_s:
                self.send(self._only)
            elif data:
                self.receive(data)
        self.tick()
        self._deliver()

    def _plug_in(self) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.terminal = os.ttyname(self._slave)
        with contextlib.suppress(FileNotFoundError):
            os.unlink(self.port)
        os.symlink(self.terminal, self.port)
        self.taken = self.put = 0
        self.clock.renew(self.port)

    def _take(self) -> bytes:
        try:
            data = os.read(self._master, 1 << 16)
        except (BlockingIOError, OSError):
            return b""
        self.taken += len(data)
        return data

    def _deliver(self) -> None:
        now = self.clock.now()
        while self._outbox and self._outbox[0][0] <= now:
            self._waiting += heapq.heappop(self._outbox)[2]
        if not self._waiting or not self.plugged:
            return
        try:
            count = os.write(self._master, self._waiting)
        except (BlockingIOError, OSError):
            count = 0
        self.put += count
        self._waiting = self._waiting[count:][:BACKLOG]
