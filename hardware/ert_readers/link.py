"""An ERT reader that speaks our own link (``ertskin.hardware.ert_readers.frame``): checked, numbered, timed scans."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ertskin.hardware.driver import SensorDriver
from ertskin.hardware.ert_readers.frame import Flag, Frame, FrameParser, Type, identity_of, scan_of
from ertskin.hardware.failure import NoAnswer, Refusal
from ertskin.hardware.instrument import Scan
from ertskin.hardware.transport import GRACE_S, Transport

ANSWER_S = 2.0
REPEATS = 4


@dataclass(frozen=True)
class Identity:
    """What the device says of itself."""

    name: str
    serial: str
    injections: int
    readings: int
    volts_per_count: float
    limit_v: float
    scan_s: float
    next: int


def parse_identity(frame: Frame) -> Identity | None:
    """The identity in a frame, or None where a field is missing or absurd."""
    fields = identity_of(frame)
    if fields is None:
        return None
    try:
        identity = Identity(
            str(fields["name"])[:80],
            str(fields["serial"])[:80],
            int(fields["injections"]),  # type: ignore[call-overload]
            int(fields["readings"]),  # type: ignore[call-overload]
            float(fields["volts_per_count"]),  # type: ignore[arg-type]
            float(fields["limit_v"]),  # type: ignore[arg-type]
            float(fields["scan_s"]),  # type: ignore[arg-type]
            int(fields["next"]),  # type: ignore[call-overload]
        )
    except (KeyError, TypeError, ValueError, OverflowError):
        return None
    sane = 0 < identity.injections < 65536 and 0 < identity.readings < 65536 and 0 <= identity.next < 1 << 32
    numbers = (identity.volts_per_count, identity.limit_v, identity.scan_s)
    return identity if sane and all(np.isfinite(number) and number > 0 for number in numbers) else None


def identity_at(transport: Transport, timeout_s: float) -> Identity | None:
    """Ask whatever is at the other end who it is; None where no device of ours answers in time."""
    transport.discard()
    transport.write(b"I\n")
    parser, clock = FrameParser(), transport.clock
    deadline = clock.now() + timeout_s
    while (left := deadline - clock.now()) > 0:
        for frame in parser.feed(transport.read(left)):
            identity = parse_identity(frame) if frame.type == Type.IDENTITY else None
            if identity is not None:
                return identity
    return None


class ErtLink(SensorDriver):
    """A reader on our own link."""

    kind = "ERT reader"

    def __init__(self, transport: Transport, shape: tuple[int, int]) -> None:
        """``shape``: (K,M) the recording expects; a device that scans otherwise is refused."""
        super().__init__(transport)
        self.shape = shape
        self.identity: Identity | None = None
        self.repeated = 0
        self._parser = FrameParser(4 * shape[0] * shape[1] + shape[0] * shape[1] // 8 + 4096)
        self._next = 0
        self._in_step = False
        self._complaint = ""
        self._lost = 0
        self._asked_s = 0.0
        self._offset_s: float | None = None

    def identify(self) -> str:
        """The device's name and serial number; also settles its scale, its shape and the next scan's number."""
        self._parser.reset()
        for _ in range(3):
            identity = identity_at(self._transport, ANSWER_S / 2)
            if identity is not None:
                return self._accepted(identity)
        raise Refusal(f"{self._name}: is no reader of our link")

    def start(self) -> None:
        """Ask for one scan now."""
        if not self._in_step:
            self.identify()
        self._parser.reset()
        self._asked_s = self._clock.now()
        self._ask()

    def finish(self, timeout_s: float) -> Scan:
        """The scan asked for. A damaged or lost one is asked for again, which takes no new scan."""
        assert self.identity is not None
        deadline = self._clock.now() + timeout_s
        patience = self.identity.scan_s + ANSWER_S / 4
        for attempt in range(REPEATS):
            damaged = self._parser.damaged
            self._complaint = ""
            until = min(deadline, self._clock.now() + patience)
            while (frame := self._frame(until, damaged)) is not None:
                scan = self._scan(frame)
                if scan is not None:
                    return scan
            if self._clock.now() >= deadline or attempt + 1 == REPEATS:
                break
            self.repeated += 1
            self._parser.reset()
            self._ask()
        self._in_step = False
        if self._complaint:
            raise Refusal(f"{self._name}: reports {self._complaint}")
        raise NoAnswer(f"{self._name}: no whole scan within {timeout_s:g} s")

    # ---------------------------------------------------------------------------------------------------- internals

    def _rejoin(self) -> None:
        self.identify()

    def _ask(self) -> None:
        self._transport.write(f"S {self._next}\n".encode("ascii"))

    def _accepted(self, identity: Identity) -> str:
        found = (identity.injections, identity.readings)
        if found != self.shape:
            raise Refusal(f"{self._name}: scans {found[0]}x{found[1]}, expected {self.shape[0]}x{self.shape[1]}")
        if self.identity is not None and identity.next >= self._next:
            self._lost += identity.next - self._next
        self.identity = identity
        self._next = identity.next
        self._offset_s = None
        self._in_step = True
        return f"{identity.name} {identity.serial}".strip()

    def _frame(self, deadline: float, damaged: int | None = None) -> Frame | None:
        """The next whole frame; None at the deadline, or as soon as a frame came damaged or the device complained."""
        while True:
            left = deadline - self._clock.now()
            if left < -GRACE_S:
                return None
            frames = self._parser.feed(self._transport.read(max(0.0, left)))
            if frames and frames[-1].type == Type.ERROR:
                self._complaint = " ".join(frames[-1].payload[:120].decode("ascii", "replace").split()) or "an error"
                return None
            if frames:
                return frames[-1]
            if left <= 0 or (damaged is not None and self._parser.damaged > damaged):
                return None

    def _scan(self, frame: Frame) -> Scan | None:
        """The scan in a frame, or None where it is another one than asked for, or of another shape."""
        read = scan_of(frame) if frame.type == Type.SCAN else None
        if read is None or read[0].shape != self.shape or frame.sequence != self._next:
            return None
        assert self.identity is not None
        count, saturated = read
        lost, self._lost = self._lost + bool(frame.flags & Flag.DROPPED), 0
        self._next = (self._next + 1) % (1 << 32)
        voltage = (count * self.identity.volts_per_count).astype(np.float32)
        return Scan(self._start_s(frame), voltage, count, saturated, frame.sequence, lost)

    def _start_s(self, frame: Frame) -> float:
        """The scan's start on our clock: after our request and a scan's duration before its arrival, between which the
        device's own clock tells."""
        device_s = 1e-6 * frame.start_us
        earliest = self._asked_s - device_s
        latest = max(earliest, self._clock.now() - 1e-6 * frame.duration_us - device_s)
        guess = earliest if self._offset_s is None else self._offset_s
        self._offset_s = min(max(guess, earliest), latest)
        return device_s + self._offset_s
