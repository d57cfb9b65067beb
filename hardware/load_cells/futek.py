"""A FUTEK USB load cell (USB210, USB220, USB520 families) in ASCII streaming: value and unit a line, at most 10 Hz.

The line is the value with a decimal point, spaces, the unit, as ``-12.345 g``: the form that public drivers of the
USB520 read (they search for a signed decimal followed by its unit); no other description of the text is public.
"""

from __future__ import annotations

import re

from ertskin.hardware.load_cells.stream import StreamingCell
from ertskin.hardware.load_cells.units import NEWTON_PER_UNIT
from ertskin.hardware.transport import Transport

_SAMPLE = re.compile(r"([+-]?\d{1,6}\.\d{1,6}) {0,3}(mN|kN|N|kg|g|lb|lbs|oz)", re.ASCII)


def parse_futek(line: str) -> float | None:
    """Newton from a value with its unit, or None where the line is no whole sample."""
    match = _SAMPLE.fullmatch(line)
    return None if match is None else float(match[1]) * NEWTON_PER_UNIT[match[2]]


def futek(transport: Transport, compression: float = 1.0) -> StreamingCell:
    """A FUTEK USB load cell; ``compression`` is -1 where it writes tension positive."""

    def parse(line: str) -> float | None:
        value = parse_futek(line)
        return None if value is None else compression * value

    return StreamingCell(transport, "FUTEK USB", parse)
