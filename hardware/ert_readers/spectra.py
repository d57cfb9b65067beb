"""An OpenEIT Spectra board: a line ``magnitudes : 1.23,4.56,...`` per scan at 115200 baud.

Protocol: OpenEIT/OpenEIT, ``OpenEIT/backend/serialhandler.py`` (the text before the colon is a label, the values behind
it are separated by commas, the mode is a letter sent after opening) and OpenEIT/EIT_Firmware: mode ``c`` is tomography
with opposite injection. 8 electrodes give 28 values, 16 give 192, 32 give 928. No checksum, no numbering, no time.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.ert_readers.text import TextReader, numbers
from ertskin.hardware.transport import Transport

_NUMBER = re.compile(r"-?\d{1,6}\.\d{1,6}", re.ASCII).fullmatch


def parse_spectra(line: str, count: int) -> NDArray[np.float64] | None:
    """(count,) magnitudes, or None where the line is no whole scan."""
    label, colon, values = line.partition(":")
    if not colon or label.strip() != "magnitudes":
        return None
    fields = [field.strip() for field in values.split(",")]
    if fields and fields[-1] == "":
        fields.pop()
    return numbers(fields, count, _NUMBER)


def spectra(transport: Transport, shape: tuple[int, int], volts_per_unit: float = 1.0) -> TextReader:
    """A Spectra in tomography mode; ``shape`` (K,M) lays its values out, ``volts_per_unit`` scales them."""
    count = shape[0] * shape[1]
    return TextReader(
        transport, shape, "OpenEIT Spectra", lambda line: parse_spectra(line, count), volts_per_unit, 0.02, b"c\n"
    )
