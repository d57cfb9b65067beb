"""The documentation's notebooks run from end to end, in a quick form."""

from __future__ import annotations

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

pytestmark = [pytest.mark.long, pytest.mark.timeout(1000)]
FOLDER = Path(__file__).resolve().parents[2] / "docs" / "notebooks"


def executed(name: str, folder: Path) -> dict[str, str]:
    """What each code cell prints, by its first line."""
    notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    NotebookClient(notebook, timeout=900, resources={"metadata": {"path": str(folder)}}).execute()
    return {
        cell.source.splitlines()[0]: "".join(out.get("text", "") for out in cell.outputs)
        for cell in notebook.cells
        if cell.cell_type == "code"
    }


@pytest.fixture(autouse=True)
def quick(monkeypatch) -> None:
    monkeypatch.setenv("ERTSKIN_QUICK", "1")


def test_there_are_three_notebooks() -> None:
    assert sorted(path.stem for path in FOLDER.glob("*.ipynb")) == ["my_own_skin", "paper", "what_was_missed"]


def test_my_own_skin(tmp_path: Path) -> None:
    cell = "simulated = ertskin.simulate(calibration, protocol, history).voltage_v"
    printed = executed("my_own_skin", tmp_path)[cell]
    at_rest, pressed = (float(line.split()[-1]) for line in printed.splitlines())
    assert at_rest == pytest.approx(1.0, abs=0.1)
    assert pressed < 3.0


def test_the_paper_in_ten_minutes(tmp_path: Path) -> None:
    printed = executed("paper", tmp_path)['(model,) = (folder / "runs" / "train").glob("*/model.pt")']
    assert float(printed.split()[2]) >= 60.0


def test_what_did_my_simulator_miss(tmp_path: Path) -> None:
    printed = executed("what_was_missed", tmp_path)['answer = ertskin.diagnose(recording, resolution="fast")']
    assert "piezo_creep" in printed
    before, after = (float(word) for word in printed.splitlines()[1].split()[2:5:2])
    assert after < 0.5 * before
