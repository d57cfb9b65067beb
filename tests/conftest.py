"""Fixtures every package's tests share."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from ertskin.cores import SHARE_VARIABLE, given_cores

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# Tests side by side share the cores: more threads than that only wait for one another.
if "PYTEST_XDIST_WORKER_COUNT" in os.environ:
    os.environ.setdefault(SHARE_VARIABLE, str(max(1, given_cores() // int(os.environ["PYTEST_XDIST_WORKER_COUNT"]))))

# A shell's background job, or nohup's, starts with some signals ignored, and so would every command the tests stop.
signal.signal(signal.SIGINT, signal.default_int_handler)
for number in (signal.SIGHUP, signal.SIGQUIT):
    signal.signal(number, signal.SIG_DFL)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long files first, in their order; workers take files in the order of the tests."""
    items.sort(key=lambda item: item.get_closest_marker("long") is None)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the public and bench recordings; skips the test where it isn't there."""
    default = Path(__file__).resolve().parents[2] / "shared"
    folder = Path(os.environ.get("ERTSKIN_DATA", default))
    if not (folder / "RECORDING_FORMAT.md").is_file():
        pytest.skip(f"recordings not found in {folder}: set ERTSKIN_DATA to the folder that holds them")
    return folder
