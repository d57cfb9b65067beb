"""Samples together: what is committed comes out again, and README says the same."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

CONCEALED = Path(__file__).parents[2] / "experiments/concealed"
sys.path.insert(0, str(CONCEALED / "proof"))

import seals  # noqa: E402
import track_record  # noqa: E402

RESULTS = CONCEALED / "results"
SAMPLES = sorted(one.parent for one in RESULTS.glob("*/opened.json.xz"))


def test_what_is_committed_comes_out_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    committed = (RESULTS / "track_record.md").read_text()
    order = [line.split("|")[1].strip() for line in committed.splitlines() if line.startswith("| ")]
    ordered = [RESULTS / name for name in order if (RESULTS / name / "opened.json.xz").exists()]
    assert sorted(ordered) == SAMPLES
    monkeypatch.setattr("sys.argv", ["track_record.py", *map(str, ordered), "--out", str(tmp_path)])
    assert track_record.main() == 0
    assert (tmp_path / "track_record.md").read_text() == committed
    assert capsys.readouterr().out == committed
    assert (tmp_path / "track_record.png").stat().st_size > 1000


def test_the_page_says_what_the_samples_show() -> None:
    page = (CONCEALED / "README.md").read_text()
    lines = [line for line in (RESULTS / "track_record.md").read_text().splitlines() if line.startswith("| ")]
    together = {cells[1].strip(): cells[3].strip() for line in lines if len(cells := line.split("|")) == 5}
    for label, numbers in together.items():
        assert not numbers[0].isdigit() or numbers in page, label
    for line in lines:
        name, *shares = (cell.strip() for cell in line.strip("|").split("|"))
        if (RESULTS / name / "opened.json.xz").exists():
            said = next(one for one in page.splitlines() if one.startswith(f"| `{name}`"))
            assert [cell.strip() for cell in said.strip("|").split("|")][2:] == shares, name


def test_a_sample_whose_seal_is_broken_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    changed = tmp_path / SAMPLES[0].name
    shutil.copytree(SAMPLES[0], changed)
    opened = seals.read_json(changed / "opened.json.xz")
    opened["cases"][sorted(opened["cases"])[0]]["truth"]["noise_v"] = 9e-3
    seals.write_json(changed / "opened.json.xz", opened)
    monkeypatch.setattr("sys.argv", ["track_record.py", str(changed), "--out", str(tmp_path)])
    assert track_record.main() == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not (tmp_path / "track_record.md").exists()
