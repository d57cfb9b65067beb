"""The specimen test from another machine: a compressometer's table of stress and resistance (paper II-C)."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from ertskin.hardware.recording import RecordingError, Specimen

COLUMNS = ("time_s", "stress_pa", "sheet_resistance_ohm_sq", "cycle")


def read_specimen_table(path: Path) -> Specimen:
    """A specimen test from a CSV file whose first line names the columns of the recording format's ``/specimen``.

    Raises ``RecordingError`` with one line for a file that is missing, lacks a column or holds anything but numbers.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{path}: found nothing readable ({error}), expected a table of a specimen test") from None
    missing = set(COLUMNS) - set(rows[0] if rows else ())
    if missing:
        raise RecordingError(f"{path}: found no column {sorted(missing)}, expected {list(COLUMNS)} in the first line")
    columns = {}
    for name in COLUMNS:
        try:
            columns[name] = np.array([float(row[name]) for row in rows])
        except (TypeError, ValueError) as error:
            raise RecordingError(f"{path}: {name}: found {error}, expected numbers") from None
        if not np.isfinite(columns[name]).all():
            raise RecordingError(f"{path}: {name}: found NaN or infinity, expected finite numbers")
    cycle = columns["cycle"]
    if (cycle % 1.0).any() or not ((cycle >= 0) & (cycle < len(cycle))).all():
        raise RecordingError(f"{path}: cycle: found other numbers, expected cycles counted from 0")
    return Specimen(columns["stress_pa"], columns["sheet_resistance_ohm_sq"], columns["time_s"], cycle.astype(np.int64))
