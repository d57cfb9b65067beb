"""A bridge on an HX711 behind a microcontroller that prints a line per sample (10 or 80 Hz, the chip's RATE pin).

The chip's datasheet (Avia Semiconductor) fixes the 24-bit counts, not the line: that is the sketch's. The layouts read:

- ``counts``: ``-123456``, the raw 24-bit count (bogde/HX711 ``read()``);
- ``plain``: ``12.34``, a value in ``unit`` (bogde/HX711 ``get_units()``);
- ``average``: ``one reading:\t12.3\t| average:\t12.4`` (bogde/HX711, examples/HX711_full_example);
- ``reading``: ``Reading: 0.12 kg calibration_factor: -7050.00`` (sparkfun/HX711-Load-Cell-Amplifier);
- ``openscale``: ``1523,0.25,kg,23.12,`` (SparkFun OpenScale hook-up guide: milliseconds, value, unit, temperatures).
"""

from __future__ import annotations

import re

from ertskin.hardware.load_cells.stream import StreamingCell
from ertskin.hardware.load_cells.units import NEWTON_PER_UNIT
from ertskin.hardware.transport import Transport

FULL_SCALE = 1 << 23
_VALUE = r"([+-]?\d{1,7}\.\d{1,4})"
LAYOUTS = {
    "counts": re.compile(r"([+-]?\d{1,8})()", re.ASCII),
    "plain": re.compile(rf"{_VALUE}()", re.ASCII),
    "average": re.compile(rf"one reading:\s{_VALUE}\s\| average:\s[+-]?\d{{1,7}}\.\d{{1,4}}()", re.ASCII),
    "reading": re.compile(
        rf"Reading: {_VALUE} (kg|lbs|g|N)(?: calibration_factor: [+-]?\d{{1,9}}\.\d{{1,4}})?", re.ASCII
    ),
    "openscale": re.compile(rf"\d{{1,10}},{_VALUE},(kg|lbs),(?:[+-]?\d{{1,3}}\.\d{{1,4}},){{0,2}}", re.ASCII),
}


def parse_hx711(line: str, layout: str, unit: str) -> float | None:
    """The value in newton, in counts for ``layout="counts"``, or None where the line is no whole sample."""
    match = LAYOUTS[layout].fullmatch(line)
    if match is None:
        return None
    if layout == "counts":
        count = int(match[1])
        return float(count) if -FULL_SCALE <= count < FULL_SCALE else None
    return float(match[1]) * NEWTON_PER_UNIT[match[2] or unit]


def hx711(
    transport: Transport,
    layout: str = "counts",
    unit: str = "N",
    newton_per_count: float = 1.0,
    zero_count: float = 0.0,
) -> StreamingCell:
    """A load cell on an HX711; ``newton_per_count`` and ``zero_count`` are for raw counts, negative where wired so."""
    if layout not in LAYOUTS:
        raise ValueError(f"layout {layout!r}: choose one of {', '.join(LAYOUTS)}")

    def parse(line: str) -> float | None:
        value = parse_hx711(line, layout, unit)
        return value if value is None or layout != "counts" else (value - zero_count) * newton_per_count

    return StreamingCell(transport, f"HX711 ({layout})", parse)
