"""A suite is diagnosed one by one, gone on with, and a diagnosis that takes too long is stopped for good."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import seals

PROOF = Path(__file__).parents[2] / "experiments/concealed/proof"
METHOD = """
import sys
from pathlib import Path
recording, out = map(Path, sys.argv[1:])
while recording.stem == "c001":
    pass
(out / "diagnosis.json").write_text("{}")
"""


@pytest.fixture
def suite(tmp_path: Path) -> Path:
    """Two recordings with their commitments; the method never comes to an end with the second."""
    (tmp_path / "recordings").mkdir()
    (tmp_path / "method.py").write_text(METHOD)
    cases = {}
    for name in ("c000", "c001"):
        recording = tmp_path / "recordings" / f"{name}.h5"
        recording.write_bytes(name.encode())
        cases[name] = {"recording": seals.file_hash(recording)}
    seals.write_json(tmp_path / "commitments.json", {"cases": cases})
    return tmp_path


def diagnosed(suite: Path) -> subprocess.CompletedProcess[str]:
    method = f"m={shlex.join([sys.executable, str(suite / 'method.py')])} {{recording}} {{out}}"
    command = [sys.executable, str(PROOF / "diagnose.py"), str(suite), "--method", method, "--cpu-s", "1"]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_one_that_takes_too_long_is_stopped_once(suite: Path) -> None:
    first = diagnosed(suite)
    assert first.returncode == 0
    assert sorted(first.stdout.splitlines()) == ["m c000: diagnosed", "m c001: stopped after 1 s of CPU"]
    assert not (suite / "diagnoses/m/c001/diagnosis.json").exists()
    again = diagnosed(suite)
    assert (again.returncode, again.stdout) == (0, "")


def test_other_bytes_than_those_committed_to_are_refused(suite: Path) -> None:
    (suite / "recordings/c000.h5").write_bytes(b"other")
    done = diagnosed(suite)
    assert done.returncode == 2
    assert "c000: the recording's bytes are not those committed" in done.stderr
    assert not (suite / "diagnoses").exists()
