"""The one clock of a recording: every timestamp and every wait goes through it."""

from __future__ import annotations

import os
import select
import time
from collections.abc import Callable
from typing import Protocol

SELECTS = os.name == "posix"
"""Whether the system can wait for a serial port; elsewhere it is looked at again and again."""
LOOK_S = 0.001
SIGN_S = 1.0
"""A wait gives a sign of life as often."""


def unheard() -> None:
    """A sign of life that nobody is waiting for."""


class Readable(Protocol):
    """A port as pyserial opens it."""

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read at once."""
        ...

    def fileno(self) -> int:
        """Its descriptor, where there are such things."""
        ...


class Clock(Protocol):
    """Seconds since an arbitrary start, and ways to let them pass."""

    sign_of_life: Callable[[], None]
    """Called by the thread that looks at the clock or waits, at every look and once a second of the wait."""

    def now(self) -> float:
        """Seconds; never runs backwards."""
        ...

    def sleep(self, seconds: float) -> None:
        """Let so many seconds pass; nothing for zero or less."""
        ...

    def wait_readable(self, port: Readable, timeout_s: float) -> bool:
        """Wait until the port can be read (also where its other end is gone); False after the time-out."""
        ...

    def opened(self, port: str) -> None:
        """Told by a transport that it opened a port: what was on the line before is gone."""
        ...

    def wrote(self, port: str, count: int) -> None:
        """Told by a transport that it put ``count`` bytes on the line: a simulated clock waits for their arrival."""
        ...

    def read(self, port: str, count: int) -> None:
        """Told by a transport that it took ``count`` bytes off the line."""
        ...


class SystemClock:
    """The machine's monotonic clock."""

    def __init__(self) -> None:
        self.sign_of_life = unheard

    def now(self) -> float:
        """Seconds since the machine's start."""
        self.sign_of_life()
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Let so many seconds pass."""
        end = self.now() + seconds
        while (left := end - self.now()) > 0:
            time.sleep(min(left, SIGN_S))

    def wait_readable(self, port: Readable, timeout_s: float) -> bool:
        """Wait until the port can be read."""
        deadline = self.now() + timeout_s
        while True:
            left = deadline - self.now()
            if self._readable(port, min(left, SIGN_S)):
                return True
            if left <= SIGN_S:
                return False

    def _readable(self, port: Readable, timeout_s: float) -> bool:
        if SELECTS:
            return bool(select.select([port.fileno()], [], [], max(0.0, timeout_s))[0])
        deadline = self.now() + timeout_s
        while not port.in_waiting:
            if self.now() >= deadline:
                return False
            self.sleep(LOOK_S)
        return True

    def opened(self, port: str) -> None:
        """Real bytes need no book-keeping."""

    def wrote(self, port: str, count: int) -> None:
        """Real bytes need no book-keeping."""

    def read(self, port: str, count: int) -> None:
        """Real bytes need no book-keeping."""
