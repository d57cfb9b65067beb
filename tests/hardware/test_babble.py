"""A device that talks without end: every call ends in its time and in the drivers' own words; nothing piles up."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from scripted_line import ScriptedClock

from ertskin.hardware.discovery import QUESTIONS
from ertskin.hardware.ert_readers.eit_kit import eit_kit
from ertskin.hardware.ert_readers.frame import Frame, Type, encode, scan_payload
from ertskin.hardware.ert_readers.link import ErtLink
from ertskin.hardware.ert_readers.spectra import spectra
from ertskin.hardware.failure import InstrumentError, NoAnswer
from ertskin.hardware.instrument import Travel
from ertskin.hardware.load_cells.futek import futek
from ertskin.hardware.load_cells.hx711 import hx711
from ertskin.hardware.load_cells.mark10 import Mark10
from ertskin.hardware.stages.grbl import Grbl
from ertskin.hardware.stages.marlin import Marlin
from ertskin.hardware.transport import GRACE_S

SHAPE = (8, 8)
BOX = Travel((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
SCAN = encode(Frame(Type.SCAN, 0, 7, 0, 0, *SHAPE, scan_payload(np.ones(SHAPE, np.int32), np.zeros(SHAPE, bool))))
IDENTITY = b'{"name": "x", "serial": "", "injections": 8, "readings": 8, "volts_per_count": 1, "limit_v": 1, '
IDENTITY = encode(Frame(Type.IDENTITY, 0, 0, 0, 0, 0, 0, IDENTITY + b'"scan_s": 0.4, "next": 3}'))
LATE_S = GRACE_S + 0.1
SAID: dict[str, Callable[[np.random.Generator], bytes]] = {
    "bytes": lambda rng: rng.bytes(200),
    "lines": lambda _rng: b"[MSG:x]\r\n" * 4,
    "numbers": lambda rng: b"%d,%d\n" % (rng.integers(-1000, 1000), rng.integers(0, 9)),
    "no end of a line": lambda _rng: b"x" * 4000,
    "scans": lambda _rng: IDENTITY + SCAN,
}
"""What stands on the line whenever it is read."""


def stage_calls(stage: Grbl | Marlin) -> dict[str, tuple[Callable[[], object], float]]:
    """Calls and the seconds each may take."""
    return {
        "identify": (stage.identify, 35.0),
        "position": (stage.position_m, 90.0),
        "moving": (stage.moving, 10.0),
        "halt": (stage.halt, 35.0),
        "recover": (stage.recover, 70.0),
        "home": (stage.home, 130.0),
    }


def cell_calls(cell: Any) -> dict[str, tuple[Callable[[], object], float]]:
    """The same of a load cell."""
    calls = {"identify": (cell.identify, 2 * (2.0 + LATE_S)), "force": (lambda: cell.force(2.0), 2.0 + LATE_S)}
    return {**calls, "discard": (cell.discard, 1.0), "restore": (cell.restore, 5.0)}


def reader_calls(reader: Any) -> dict[str, tuple[Callable[[], object], float]]:
    """The same of a reader."""

    def scan() -> None:
        reader.start()
        reader.finish(4.0)

    return {"identify": (reader.identify, 6.0), "restore": (reader.restore, 6.0), "scan": (scan, 6.0 + 4.0 + LATE_S)}


DRIVERS: dict[str, Callable[[Any], dict[str, tuple[Callable[[], object], float]]]] = {
    "grbl": lambda line: stage_calls(Grbl(line, BOX)),
    "marlin": lambda line: stage_calls(Marlin(line, BOX)),
    "hx711": lambda line: cell_calls(hx711(line)),
    "futek": lambda line: cell_calls(futek(line)),
    "mark10": lambda line: cell_calls(Mark10(line)),
    "link": lambda line: reader_calls(ErtLink(line, SHAPE)),
    "spectra": lambda line: reader_calls(spectra(line, SHAPE)),
    "eit_kit": lambda line: reader_calls(eit_kit(line, 8)),
    "discovery": lambda line: {"ask": (lambda: [ask(line) for asks in QUESTIONS.values() for ask in asks], 40.0)},
}


class Babble:
    """A line on which something stands whenever it is read."""

    name = "babble"

    def __init__(self, said: Callable[[np.random.Generator], bytes]) -> None:
        self.clock = ScriptedClock()
        self._said, self._rng = said, np.random.default_rng(0)

    def read(self, timeout_s: float) -> bytes:
        self.clock.sleep(0.05)
        assert self.clock.now() < 1e3, "hangs"
        return self._said(self._rng)

    def write(self, data: bytes) -> None:
        """Heard by nobody."""

    def discard(self) -> None:
        """More comes at once."""

    def reopen(self) -> None:
        """Nothing changes."""

    def restore(self, timeout_s: float) -> bool:
        return False


@pytest.mark.parametrize("said", SAID)
@pytest.mark.parametrize("driver", DRIVERS)
def test_babble(driver: str, said: str) -> None:
    line = Babble(SAID[said])
    calls = DRIVERS[driver](line)
    tracemalloc.start()
    for name, (call, allowed_s) in calls.items():
        begin = line.clock.now()
        with suppress(InstrumentError):
            call()
        took = line.clock.now() - begin
        assert took <= allowed_s, f"{name} took {took:.1f} s"
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 4 << 20


def test_a_move_that_stays_busy_ends() -> None:
    said = iter([b"X:0.00 Y:0.00 Z:0.00 E:0.00\nok\n", b"ok\n"])
    line = Babble(lambda _rng: next(said, b"echo:busy: processing\n"))
    stage = Marlin(line, BOX)
    assert stage.start_move(np.array([0.1, 0.0, 0.0]), 0.01) == pytest.approx(10.0)
    with pytest.raises(NoAnswer, match="busy"):
        stage.position_m()
    assert line.clock.now() < 150.0
