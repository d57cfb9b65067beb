"""What the documentation promises: from a MAT file of an adjacent tank to its calibration in ten lines."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from ertskin.calibration.store import load_calibration
from ertskin.cli import main

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
