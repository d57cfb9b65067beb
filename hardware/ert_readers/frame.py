"""The frames of our own ERT link: what the bytes mean. Pure functions and a parser, no port.

All numbers are little-endian. A frame is a header, a payload and a checksum:

======  ====  ==================================================================================================
offset  size  meaning
======  ====  ==================================================================================================
0       4     magic ``A5 5A 45 52``
4       1     version, 1
5       1     type: 1 scan, 2 identity, 3 error
6       2     flags of a scan: bit 0 some reading saturated, bit 1 the device dropped a scan before this one,
              bit 2 first scan since the device started
8       4     sequence number of the scan, counted by the device, wrapping at 2^32
12      8     device clock at the scan's start, microseconds
20      4     duration of the scan, microseconds
24      2     K, injections
26      2     M, readings per injection
28      4     payload length in bytes
32      4     CRC-32 (as zlib and IEEE 802.3 have it) of bytes 0 to 31: a damaged length is never waited for
36            payload
        4     CRC-32 of the payload
======  ====  ==================================================================================================

A scan's payload is K*M counts of four bytes, signed, injection by injection, then a bit per reading, least significant
first, set where the converter was at its limit. An identity's payload is JSON: ``name``, ``serial``, ``injections``,
``readings``, ``volts_per_count``, ``limit_v``, ``scan_s``, ``next`` (the number of the scan to come). An error's
payload is a line of text.

The host sends lines ending in a line feed: ``I``, identify, and ``S <sequence>``, that scan: made now where it is the
next one, sent again where it is one of the last four, an error otherwise. So a request that was lost, or whose answer
was, can be repeated without a scan being made twice or missed.
"""

from __future__ import annotations

import json
import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

MAGIC = b"\xa5\x5aER"
VERSION = 1
HEADER = struct.Struct("<4sBBHIQIHHI")
CHECKSUM = struct.Struct("<I")
LARGEST_PAYLOAD = 1 << 20


class Type(IntEnum):
    """What a frame carries."""

    SCAN = 1
    IDENTITY = 2
    ERROR = 3


class Flag(IntEnum):
    """Bits of a scan's flags."""

    SATURATED = 1
    DROPPED = 2
    FIRST = 4


@dataclass(frozen=True)
class Frame:
    """One frame whose checksums hold."""

    type: Type
    flags: int
    sequence: int
    start_us: int
    duration_us: int
    injections: int
    readings: int
    payload: bytes


def encode(frame: Frame) -> bytes:
    """The bytes of a frame."""
    header = HEADER.pack(
        MAGIC, VERSION, frame.type, frame.flags, frame.sequence, frame.start_us, frame.duration_us,
        frame.injections, frame.readings, len(frame.payload),
    )  # fmt: skip
    return header + CHECKSUM.pack(zlib.crc32(header)) + frame.payload + CHECKSUM.pack(zlib.crc32(frame.payload))


def scan_payload(count: NDArray[np.int32], saturated: NDArray[np.bool_]) -> bytes:
    """The payload of (K,M) counts and saturation marks."""
    return count.astype("<i4").tobytes() + np.packbits(saturated.ravel(), bitorder="little").tobytes()


def scan_of(frame: Frame) -> tuple[NDArray[np.int32], NDArray[np.bool_]] | None:
    """(K,M) counts and saturation marks of a scan, or None where the payload has another length."""
    shape = (frame.injections, frame.readings)
    size = shape[0] * shape[1]
    if size == 0 or len(frame.payload) != 4 * size + (size + 7) // 8:
        return None
    count = np.frombuffer(frame.payload, dtype="<i4", count=size).astype(np.int32).reshape(shape)
    bits = np.frombuffer(frame.payload, dtype=np.uint8, offset=4 * size)
    saturated = np.unpackbits(bits, count=size, bitorder="little").astype(bool).reshape(shape)
    return count, saturated


def identity_of(frame: Frame) -> dict[str, object] | None:
    """The fields of an identity, or None where the payload is no JSON object."""
    try:
        fields = json.loads(frame.payload)
    except (ValueError, RecursionError):
        return None
    return fields if isinstance(fields, dict) else None


class FrameParser:
    """Finds frames in a stream of bytes; noise is skipped, a damaged frame is dropped and counted."""

    def __init__(self, largest_payload: int = LARGEST_PAYLOAD) -> None:
        """``largest_payload``: bytes; a header that claims more is damaged."""
        self._pending = bytearray()
        self._largest = largest_payload
        self.damaged = 0

    def feed(self, data: bytes) -> list[Frame]:
        """The frames completed by ``data``. Keeps at most one frame's worth of bytes."""
        self._pending += data
        frames: list[Frame] = []
        while (frame := self._next()) is not None:
            if isinstance(frame, Frame):
                frames.append(frame)
        return frames

    def reset(self) -> None:
        """Forget what has arrived."""
        self._pending.clear()

    def _next(self) -> Frame | bool | None:
        """The next frame, True where a damaged one was dropped, or None where more bytes are needed."""
        start = self._pending.find(MAGIC)
        if start < 0:
            del self._pending[: max(0, len(self._pending) - len(MAGIC) + 1)]
            return None
        del self._pending[:start]
        if len(self._pending) < HEADER.size + CHECKSUM.size:
            return None
        header = bytes(self._pending[: HEADER.size])
        _, version, kind, flags, sequence, start_us, duration_us, injections, readings, length = HEADER.unpack(header)
        (checksum,) = CHECKSUM.unpack_from(self._pending, HEADER.size)
        known = version == VERSION and kind in Type.__members__.values() and length <= self._largest
        if checksum != zlib.crc32(header) or not known:
            return self._drop()
        body = HEADER.size + CHECKSUM.size
        if len(self._pending) < body + length + CHECKSUM.size:
            return None
        payload = bytes(self._pending[body : body + length])
        (checksum,) = CHECKSUM.unpack_from(self._pending, body + length)
        if checksum != zlib.crc32(payload):
            return self._drop()
        del self._pending[: body + length + CHECKSUM.size]
        return Frame(Type(kind), flags, sequence, start_us, duration_us, injections, readings, payload)

    def _drop(self) -> bool:
        """Step over a magic that began no whole frame."""
        self.damaged += 1
        del self._pending[: len(MAGIC)]
        return True
