"""The emulated instruments in real time: for programs in other processes, as a bench on a desk would be."""

from __future__ import annotations

import select
import threading

from ertskin.hardware.clock import SystemClock
from ertskin.hardware.virtual.terminal import Terminal

LONGEST_WAIT_S = 0.02


class RealTimeClock(SystemClock):
    """The machine's clock, for devices."""

    def renew(self, port: str) -> None:
        """Real bytes need no book-keeping."""

    def attach(self, device: Terminal) -> None:
        """Real devices keep their own time."""


class Server:
    """Keeps devices going in a thread until closed."""

    def __init__(self, devices: list[Terminal]) -> None:
        self._devices = devices
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        self._ending.set()
        self._thread.join(5.0)

    def _serve(self) -> None:
        while not self._ending.is_set():
            for device in self._devices:
                device.pump()
            now = self._devices[0].clock.now()
            wait = min([LONGEST_WAIT_S, *(device.due_s() - now for device in self._devices)])
            descriptors = [device.descriptor for device in self._devices if device.plugged]
            select.select(descriptors, [], [], max(0.0, wait))
