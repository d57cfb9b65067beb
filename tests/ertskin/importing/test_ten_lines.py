"""What the documentation promises: an adjacent tank calibrated in ten lines, a logger's presses imported whole."""

from __future__ import annotations

import csv
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from ertskin.calibration.store import load_calibration
from ertskin.cli import main
from ertskin.hardware.recording import read_recording
from ertskin.hardware.uses import uses_of

sys.path.insert(0, str(Path(__file__).parent))
from tank import CONTACT_OHM, SHEET_OHM_SQ, tank_readings, write_mat

PAGE = Path(__file__).resolve().parents[3] / "docs" / "how-to" / "import.md"


def block(title: str) -> list[str]:
    """Lines of the page's block of that title."""
    found = re.search(rf'```\w+ title="{title}"\n(.*?)```', PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None, title
    return found.group(1).splitlines()


def test_the_pages_mapping_and_commands_calibrate_the_tank(tmp_path: Path, monkeypatch) -> None:
    mapping, commands = block("tank.yaml"), block("two commands")
    assert len(mapping) + len(commands) <= 10
    monkeypatch.chdir(tmp_path)
    write_mat(tmp_path / "tank.mat", {"V": tank_readings().T})
    Path("tank.yaml").write_text("\n".join(mapping))
    for command in commands:
        program, *arguments = command.split()
        assert program == "ertskin"
        assert main(arguments) == 0
    (written,) = Path("runs").rglob("calibration.yaml")
    found = load_calibration(written)
    assert found.known_sensor.sheet_resistance_ohm_sq == pytest.approx(SHEET_OHM_SQ, rel=0.02)
    np.testing.assert_allclose(found.contact_resistance_ohm, np.full(16, CONTACT_OHM), rtol=0.1)


def write_csv(path: Path, heads: list[str], rows: list[list[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([heads, *rows])


def test_the_pages_mapping_of_presses_makes_a_recording_to_train_on(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("import.yaml").write_text("\n".join(block("import.yaml")))
    rng, readings = np.random.default_rng(0), 208
    resting = rng.uniform(1e-3, 1e-2, readings)
    rows: list[list[object]] = []
    for press in range(3):
        for phase in range(4):
            touched = [30.0 + 20 * press, 40.0, 2.0, 1.5] if phase else [""] * 4
            rows.append([0.5 * len(rows), *(resting + 1e-6 * rng.standard_normal(readings)), *touched, phase])
    rows.append([0.5 * len(rows), *resting, *[""] * 4, 0])
    write_csv(
        Path("presses.csv"), ["t", *(f"v_{k}" for k in range(readings)), "x_mm", "y_mm", "z_mm", "f", "phase"], rows
    )
    law = [[k, 1.5e3 * (k % 20), 2e4 * (1 - 0.02 * (k % 20)), k // 20] for k in range(40)]
    write_csv(Path("fabric.csv"), ["t", "stress", "resistance", "cycle"], law)
    assert main(["import", "source=presses.csv", "mapping=import.yaml"]) == 0
    recording = read_recording(Path("presses.h5"))
    assert recording.frames is not None
    history = recording.frames.history
    assert history.phase.tolist() == [0, 1, 2, 3] * 3 + [0]
    assert history.press[history.touched[:, 0]].tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    np.testing.assert_allclose(history.contact_m[1, 0], [0.03, 0.04])
    np.testing.assert_allclose(history.depth_m[1], [0.002])
    assert np.isfinite(recording.frames.voltage_v).sum() == 13 * readings
    able = {use.name for use in uses_of(recording) if use.able}
    assert {"synthesize, train", "diagnose: readings"} <= able
