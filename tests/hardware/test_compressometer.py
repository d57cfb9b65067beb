"""A compressometer's table: read as written, refused in a line, whatever bytes it is made of."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from ertskin.hardware.compressometer import COLUMNS, read_specimen_table
from ertskin.hardware.recording import RecordingError

TABLE = ",".join(COLUMNS) + "\n0.0,0.0,4000,0\n1.0,3e4,2500,0\n2.0,0.0,3900.5,1\n"


def test_a_table_is_read(tmp_path: Path) -> None:
    path = tmp_path / "specimen.csv"
    path.write_text(TABLE)
    specimen = read_specimen_table(path)
    np.testing.assert_array_equal(specimen.stress_pa, [0.0, 3e4, 0.0])
    np.testing.assert_array_equal(specimen.sheet_resistance_ohm_sq, [4000.0, 2500.0, 3900.5])
    np.testing.assert_array_equal(specimen.cycle, [0, 0, 1])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "no column"),
        ("a,b\n1,2\n", "no column"),
        (TABLE + "1,2\n", "numbers"),
        (TABLE + "1,2,x,0\n", "numbers"),
        (TABLE + "1,nan,2,0\n", "finite"),
        (TABLE + "1,2,3,1e300\n", "cycle"),
        (TABLE + "1,2,3,0.5\n", "cycle"),
    ],
)
def test_what_is_no_table_is_reported(text: str, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "specimen.csv"
    path.write_text(text)
    with pytest.raises(RecordingError, match=expected):
        read_specimen_table(path)
    with pytest.raises(RecordingError, match=r"absent\.csv"):
        read_specimen_table(tmp_path / "absent.csv")


def test_any_bytes(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    path = tmp_path / "specimen.csv"
    for _ in range(200):
        damaged = bytearray(TABLE.encode())
        for _ in range(int(rng.integers(1, 6))):
            damaged[int(rng.integers(0, len(damaged)))] = int(rng.integers(0, 256))
        path.write_bytes(bytes(damaged) if rng.random() < 0.7 else rng.bytes(300))
        with suppress(RecordingError):
            read_specimen_table(path)
