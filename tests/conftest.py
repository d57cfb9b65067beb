"""Fixtures every package's tests share."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# A shell's background job starts with Ctrl-C ignored, and so would every command the tests stop that way.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the public and bench recordings; skips the test where it isn't there."""
    default = Path(__file__).resolve().parents[2] / "shared"
    folder = Path(os.environ.get("ERTSKIN_DATA", default))
    if not (folder / "RECORDING_FORMAT.md").is_file():
        pytest.skip(f"recordings not found in {folder}: set ERTSKIN_DATA to the folder that holds them")
    return folder
