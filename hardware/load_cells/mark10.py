"""A Mark-10 force gauge: asked with ``?``, it answers ``4.285 N``.

Protocol: Mark-10 Series 4 and 5 user's guides, "Command set / Gauge Control Language 2". Requests end in a carriage
return, answers in carriage return and line feed; compression is positive; errors are ``*10`` illegal command, ``*11``
not applicable, ``*12`` invalid specifier, ``*22`` value too large.
"""

from __future__ import annotations

import re

from ertskin.hardware.driver import SensorDriver
from ertskin.hardware.failure import NoAnswer, Refusal
from ertskin.hardware.instrument import Force
from ertskin.hardware.load_cells.units import NEWTON_PER_UNIT
from ertskin.hardware.transport import Lines, Transport

ANSWER_S = 0.3
PERIOD_S = 0.05
"""Asked no more often than twenty times a second."""
_READING = re.compile(r"([+-]?\d{1,5}(?:\.\d{1,4})?) (N|mN|kN|lbF|ozF|kgF|gF)", re.ASCII)
_ERROR = re.compile(r"\*(?:10|11|12|22)", re.ASCII)


def parse_mark10(line: str) -> float | None:
    """Newton from a reading, or None where the line is no whole reading."""
    match = _READING.fullmatch(line)
    return None if match is None else float(match[1]) * NEWTON_PER_UNIT[match[2]]


class Mark10(SensorDriver):
    """A Mark-10 force gauge."""

    kind = "load cell"

    def __init__(self, transport: Transport) -> None:
        """The gauge must be set to send units, which it does by default."""
        super().__init__(transport)
        self.garbled = 0
        self._asked_s = -PERIOD_S
        self._lines = Lines(transport, longest=256)

    def identify(self) -> str:
        """The gauge's kind, once it has answered a request."""
        try:
            self.force(1.0)
        except NoAnswer:
            raise Refusal(f"{self._name}: does not answer '?'") from None
        return "Mark-10"

    def force(self, timeout_s: float) -> Force:
        """Ask for the reading now, and again where the answer is lost or damaged."""
        clock = self._clock
        deadline = clock.now() + timeout_s
        while clock.now() < deadline:
            clock.sleep(min(self._asked_s + PERIOD_S, deadline) - clock.now())
            self._asked_s = clock.now()
            self._transport.write(b"?\r")
            patience = min(deadline, clock.now() + ANSWER_S)
            line = self._lines.next(patience - clock.now())
            if line is None:
                continue
            value = parse_mark10(line)
            if value is not None:
                return Force(clock.now(), value)
            if _ERROR.fullmatch(line):
                raise Refusal(f"{self._name}: answers {line} to '?'")
            self.garbled += 1
            self._lines.discard()
        raise NoAnswer(f"{self._name}: no reading within {timeout_s:g} s")

    def discard(self) -> None:
        """Forget answers that came late."""
        self._lines.discard()

    def _rejoin(self) -> None:
        self.discard()
