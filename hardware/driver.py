"""What every driver does with its line: name it in messages, open it anew after a failure, let go of it."""

from __future__ import annotations

from abc import ABC, abstractmethod

from ertskin.hardware.transport import RECONNECT_S, Transport


class Driver:
    """One instrument at the end of one line."""

    kind = "instrument"

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._clock = transport.clock

    def close(self) -> None:
        """Let go of the line."""
        self._transport.close()

    @property
    def _name(self) -> str:
        return f"{self.kind} {self._transport.name}"


class SensorDriver(Driver, ABC):
    """An instrument that is read: after a failure all it takes is to fall in with the device again."""

    def restore(self) -> None:
        """Open the line anew where contact was lost, and fall in with the device."""
        self._transport.restore(RECONNECT_S)
        self._rejoin()

    @abstractmethod
    def _rejoin(self) -> None:
        """Fall in with a device that may have sent, lost or restarted anything meanwhile."""
