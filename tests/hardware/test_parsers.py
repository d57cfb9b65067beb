"""Any bytes into any parser: no exception comes out, and nothing piles up."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scripted_line import ScriptedLine

from ertskin.hardware.ert_readers.eit_kit import parse_eit_kit
from ertskin.hardware.ert_readers.frame import Frame, FrameParser, Type, encode, identity_of, scan_of, scan_payload
from ertskin.hardware.ert_readers.link import parse_identity
from ertskin.hardware.ert_readers.spectra import parse_spectra
from ertskin.hardware.load_cells.futek import parse_futek
from ertskin.hardware.load_cells.hx711 import LAYOUTS, parse_hx711
from ertskin.hardware.load_cells.mark10 import parse_mark10
from ertskin.hardware.stages.grbl import parse_status
from ertskin.hardware.stages.marlin import parse_position
from ertskin.hardware.transport import Lines

LINE_PARSERS: dict[str, tuple[Callable[[str], object], str]] = {
    "grbl": (parse_status, "<Idle|MPos:-10.000,-20.000,-5.000|FS:0,0|WCO:1.000,2.000,3.000>"),
    "marlin": (parse_position, "X:1.00 Y:2.00 Z:3.00 E:0.00 Count X:80 Y:160 Z:1200"),
    "mark10": (parse_mark10, "4.285 N"),
    "futek": (parse_futek, "-12.345 g"),
    "spectra": (lambda line: parse_spectra(line, 4), "magnitudes : 1.5,2.5,3.5,4.5"),
    "eit_kit": (lambda line: parse_eit_kit(line, 2), "1.0000,2.0000,3.0000,4.0000"),
    **{
        f"hx711 {layout}": (lambda line, layout=layout: parse_hx711(line, layout, "N"), text)  # type: ignore[misc]
        for layout, text in zip(
            LAYOUTS,
            ("-123456", "12.340", "one reading:\t1.5\t| average:\t1.4", "Reading: 0.500 kg", "1523,0.25,kg,23.12,"),
            strict=True,
        )
    },
}


@pytest.mark.parametrize("name", LINE_PARSERS)
def test_the_example_is_understood(name: str) -> None:
    parse, text = LINE_PARSERS[name]
    assert parse(text) is not None


@pytest.mark.parametrize("name", LINE_PARSERS)
def test_no_line_raises(name: str) -> None:
    parse, text = LINE_PARSERS[name]
    rng = np.random.default_rng(0)
    for _ in range(2000):
        if rng.random() < 0.5:
            line = rng.bytes(int(rng.integers(0, 80))).decode("ascii", "replace")
        else:
            damaged = list(text)
            for _ in range(int(rng.integers(1, 4))):
                damaged[int(rng.integers(0, len(damaged)))] = chr(int(rng.integers(0, 0x180)))
            line = "".join(damaged)
        parse(line)
    for line in ("", " ", "9" * 5000, "1e999", "nan", "inf", "-", ":", "<|>", "<Idle|MPos:,,>", "\ufffd", "١.٥ N"):
        parse(line)


@pytest.mark.parametrize("text", ["nan N", "inf N", "1e5 N", "4.285", "4.285 X", "--1 N", "٤.٢٨٥ N", "4.285 N N"])
def test_what_is_no_reading_is_none(text: str) -> None:
    assert parse_mark10(text) is None


def test_counts_beyond_24_bits_are_none() -> None:
    assert parse_hx711("8388607", "counts", "N") == 8388607
    assert parse_hx711("8388608", "counts", "N") is None


def frame(sequence: int) -> bytes:
    count = np.full((3, 2), sequence, dtype=np.int32)
    return encode(Frame(Type.SCAN, 0, sequence, 0, 0, 3, 2, scan_payload(count, count > 5)))


def test_frames_come_out_however_the_bytes_are_cut() -> None:
    stream = b"noise" + b"".join(frame(k) + b"\xa5\x5aE" * (k % 3) for k in range(50))
    rng = np.random.default_rng(1)
    parser, found = FrameParser(), []
    while stream:
        cut = int(rng.integers(1, 100))
        found += parser.feed(stream[:cut])
        stream = stream[cut:]
    assert [one.sequence for one in found] == list(range(50))


def test_no_single_damaged_byte_gets_through() -> None:
    whole = frame(3)
    for at in range(len(whole)):
        for bit in range(8):
            damaged = bytearray(whole)
            damaged[at] ^= 1 << bit
            frames = FrameParser().feed(bytes(damaged) + bytes(2000))
            assert frames == []


def test_a_frame_behind_a_damaged_one_is_found() -> None:
    damaged = bytearray(frame(1))
    damaged[45] ^= 1
    parser = FrameParser()
    assert [one.sequence for one in parser.feed(bytes(damaged) + frame(2))] == [2]
    assert parser.damaged == 1


def test_frames_out_of_noise_never_and_memory_bounded() -> None:
    rng = np.random.default_rng(2)
    parser = FrameParser(largest_payload=4096)
    for _ in range(300):
        data = rng.bytes(1000)
        if rng.random() < 0.3:
            data += frame(1)[: int(rng.integers(4, 40))]
        assert parser.feed(data) == []
        assert len(parser._pending) < 4096 + 64 + 2000


def test_payloads_of_any_bytes() -> None:
    rng = np.random.default_rng(3)
    for kind in Type:
        for _ in range(500):
            payload = rng.bytes(int(rng.integers(0, 60)))
            one = Frame(kind, 0, 0, 0, 0, int(rng.integers(0, 5)), int(rng.integers(0, 5)), payload)
            scan_of(one)
            identity_of(one)
            parse_identity(one)
    for text in (b"[" * 100_000, b"{}", b"null", b'{"name": {}}', b'{"injections": 1e400}'):
        parse_identity(Frame(Type.IDENTITY, 0, 0, 0, 0, 0, 0, text))


def test_lines_without_end_do_not_fill_the_memory_or_hold_us() -> None:
    line = ScriptedLine(unasked=b"x" * 500_000)
    lines = Lines(line, longest=1000)
    assert lines.next(1.0) is None
    assert len(lines._pending) <= 1000
    assert lines.overlong >= 1
    line.say(b"tail of it\n4.285 N\n")
    assert lines.next(1.0) == "4.285 N"


def test_empty_lines_do_not_hold_us() -> None:
    class Chatter(ScriptedLine):
        def read(self, timeout_s: float) -> bytes:
            self.clock.sleep(0.01)
            return b"\r\n\r\n"

    assert Lines(Chatter()).next(1.0) is None
