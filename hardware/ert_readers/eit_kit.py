"""An EIT-kit board: N*N comma-separated values a line, one per pair of drive and measurement (N electrodes).

Protocol: HCIELab/EIT-kit_open-source, Arduino library (``EITKitArduino.cpp``): root-mean-square values with four
decimals, drive pattern and measurement pattern adjacent or opposite, no checksum, no numbering, no time. Words it
prints while it starts (``Board Initialized``, ``Beginning Calibration``, ``origin frame``) are skipped.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.ert_readers.text import TextReader, numbers
from ertskin.hardware.transport import Transport

_NUMBER = re.compile(r"-?\d{1,6}\.\d{1,6}", re.ASCII).fullmatch


def parse_eit_kit(line: str, electrodes: int) -> NDArray[np.float64] | None:
    """(N*N,) values, or None where the line is no whole frame."""
    fields = [field.strip() for field in line.split(",")]
    if fields and fields[-1] == "":
        fields.pop()
    return numbers(fields, electrodes * electrodes, _NUMBER)


def eit_kit(transport: Transport, electrodes: int, volts_per_unit: float = 1.0) -> TextReader:
    """An EIT-kit board with ``electrodes`` on one band."""
    return TextReader(
        transport,
        (electrodes, electrodes),
        "EIT-kit",
        lambda line: parse_eit_kit(line, electrodes),
        volts_per_unit,
        0.02,
    )
