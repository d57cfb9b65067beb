"""Bytes to and from an instrument, apart from what they mean. Every call ends within a stated time."""

from __future__ import annotations

import contextlib
import re
from typing import Protocol

import serial
from serial.tools import list_ports

from ertskin.hardware.clock import Clock
from ertskin.hardware.failure import InstrumentError, LostContact, NoAnswer

WRITE_TIMEOUT_S = 5.0
LONGEST_LINE = 1 << 16
_USB = re.compile(r"usb:([0-9a-f]{1,4}):([0-9a-f]{1,4})(?::(.+))?", re.ASCII | re.IGNORECASE)
RECONNECT_S = 10.0
"""How long a line that was lost is tried again."""
GRACE_S = 1.0
"""How long after its time a late caller may still take what has arrived: no longer, or a device that talks without end
would hold it for ever."""
DISCARD_READS = 64
"""Reads that empty every buffer between us and a device, however much it talks meanwhile."""


class Transport(Protocol):
    """A line to one instrument."""

    name: str
    clock: Clock

    def write(self, data: bytes) -> None:
        """Send all of ``data``; raises ``LostContact`` or, after five seconds, ``NoAnswer``."""
        ...

    def read(self, timeout_s: float) -> bytes:
        """What has arrived, waiting at most ``timeout_s`` for the first byte; empty on time-out.

        Raises ``LostContact`` where the other end is gone.
        """
        ...

    def discard(self) -> None:
        """Throw away what has arrived."""
        ...

    def reopen(self) -> None:
        """Open the line anew; raises ``LostContact`` where there is nothing to open."""
        ...

    def restore(self, timeout_s: float) -> bool:
        """Where contact is lost, try to open the line anew for so long; whether that was needed.

        Raises ``LostContact`` where it did not succeed.
        """
        ...

    def close(self) -> None:
        """Let go of the line; never raises."""
        ...


def find_port(port: str) -> str:
    """The device of ``port``: a name as it is, ``usb:VID:PID`` or ``usb:VID:PID:SERIAL`` (hexadecimal) looked up.

    Raises ``LostContact`` where no port has these identifiers, ``InstrumentError`` where several have, ``ValueError``
    for identifiers that are none.
    """
    if not port.startswith("usb:"):
        return port
    match = _USB.fullmatch(port)
    if match is None:
        raise ValueError(f"{port}: expected usb:VID:PID or usb:VID:PID:SERIAL, VID and PID hexadecimal")
    vendor, product, number = int(match[1], 16), int(match[2], 16), match[3]
    found = [
        item.device
        for item in list_ports.comports()
        if (item.vid, item.pid) == (vendor, product) and number in (None, item.serial_number)
    ]
    if not found:
        raise LostContact(f"{port}: no such USB device is plugged in")
    if len(found) > 1:
        raise InstrumentError(f"{port}: {len(found)} devices match ({', '.join(found)}); add the serial number")
    return str(found[0])


class SerialTransport:
    """A serial port by name or USB identifiers, 8N1, opened for us alone."""

    def __init__(self, port: str, baud: int, clock: Clock) -> None:
        """Open ``port``; raises ``LostContact``."""
        self.name = port
        self.clock = clock
        self._baud = baud
        self._serial: serial.Serial | None = None
        self.reopen()

    def reopen(self) -> None:
        """Close and open the port anew, looking its USB identifiers up again."""
        self.close()
        device = find_port(self.name)
        try:
            self._serial = serial.Serial(device, self._baud, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True)
        except (serial.SerialException, OSError, ValueError) as error:
            raise LostContact(f"{self.name}: can't be opened ({_reason(error)})") from None
        self.clock.opened(self.name)

    def restore(self, timeout_s: float) -> bool:
        """Where contact is lost, try to open the port anew for so long."""
        with contextlib.suppress(LostContact):
            self.discard()
            return False
        deadline = self.clock.now() + timeout_s
        while True:
            try:
                self.reopen()
                return True
            except LostContact:
                if self.clock.now() >= deadline:
                    raise
            self.clock.sleep(0.25)

    def write(self, data: bytes) -> None:
        """Send all of ``data``."""
        if self._serial is None:
            raise LostContact(f"{self.name}: is closed")
        try:
            self._serial.write(data)
        except serial.SerialTimeoutException:
            raise NoAnswer(f"{self.name}: took nothing for {WRITE_TIMEOUT_S:g} s") from None
        except (serial.SerialException, OSError) as error:
            raise self._lost(error) from None
        self.clock.wrote(self.name, len(data))

    def read(self, timeout_s: float) -> bytes:
        """What has arrived."""
        if self._serial is None:
            raise LostContact(f"{self.name}: is closed")
        try:
            if not self.clock.wait_readable(self._serial, timeout_s):
                return b""
            data = bytes(self._serial.read(1 << 16))
        except (serial.SerialException, OSError, ValueError, TypeError) as error:
            raise self._lost(error) from None
        self.clock.read(self.name, len(data))
        return data

    def discard(self) -> None:
        """Throw away what has arrived."""
        for _ in range(DISCARD_READS):
            if not self.read(0.0):
                return

    def close(self) -> None:
        """Let go of the port."""
        if self._serial is not None:
            with contextlib.suppress(serial.SerialException, OSError):
                self._serial.close()
            self._serial = None

    def _lost(self, error: BaseException) -> LostContact:
        self.close()
        return LostContact(f"{self.name}: contact lost ({_reason(error)})")


def _reason(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


class Lines:
    """Text lines from a transport; noise can neither raise nor fill the memory."""

    def __init__(self, transport: Transport, longest: int = LONGEST_LINE) -> None:
        """``longest``: bytes kept while waiting for a line's end; longer ones are dropped whole."""
        self._transport = transport
        self._longest = longest
        self._pending = bytearray()
        self._dropping = False
        self.overlong = 0

    def next(self, timeout_s: float) -> str | None:
        """The next line that is not empty, its ends stripped, or None after ``timeout_s``.

        A caller whose time is over takes what has arrived, for ``GRACE_S`` and no longer. Bytes outside ASCII come as
        U+FFFD, which no parser takes for anything.
        """
        if timeout_s < -GRACE_S:
            return None
        clock = self._transport.clock
        deadline = clock.now() + timeout_s
        late = False
        while True:
            line = self._take()
            if line:
                return line
            if line is None:
                # Chatter without a line in it must not hold us beyond the time-out.
                if late:
                    return None
                left = deadline - clock.now()
                late = left <= 0
                self._pending += self._transport.read(max(0.0, left))

    def discard(self) -> None:
        """Forget what has arrived."""
        self._pending.clear()
        self._dropping = False
        self._transport.discard()

    def _take(self) -> str | None:
        end = self._pending.find(b"\n")
        if end < 0:
            if len(self._pending) > self._longest:
                self._pending.clear()
                self._dropping = True
                self.overlong += 1
            return None
        raw = bytes(self._pending[:end])
        del self._pending[: end + 1]
        if self._dropping or len(raw) > self._longest:
            self._dropping = False
            return ""
        return raw.decode("ascii", "replace").strip("\r\n\0 \t")
