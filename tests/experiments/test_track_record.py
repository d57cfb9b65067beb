"""Samples together: what is committed comes out again, and the page says the same."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import record
import seals
import suite
from by_effect import found
from judged import Judged
from rows import Share

CONCEALED = Path(__file__).parents[2] / "experiments/concealed"
RESULTS = CONCEALED / "results"
SUITES = RESULTS / "final314", RESULTS / "final310"
"""Those opened whole, the last one first."""
SAMPLES = sorted(one.parent for one in RESULTS.glob("*/opened.json.xz") if one.parent not in SUITES)


def track_record(samples: list[Path], out: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(CONCEALED / "proof/track_record.py"), *map(str, samples), "--out", str(out)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


@pytest.fixture(scope="module")
def table() -> list[list[str]]:
    """The lines committed, cell by cell."""
    lines = (RESULTS / "track_record.md").read_text().splitlines()
    return [cells(line) for line in lines if line.startswith("| ")]


def test_what_is_committed_comes_out_again(table: list[list[str]], tmp_path: Path) -> None:
    ordered = [RESULTS / name for name, *_ in table if (RESULTS / name / "opened.json.xz").exists() and name]
    assert sorted(ordered) == SAMPLES
    done = track_record(ordered, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout == (tmp_path / "track_record.md").read_text() == (RESULTS / "track_record.md").read_text()
    assert (tmp_path / "track_record.png").stat().st_size > 1000


def test_pages_say_what_the_samples_show(table: list[list[str]]) -> None:
    page = (CONCEALED / "samples.md").read_text()
    said = {one[0].strip("`"): one for line in page.splitlines() if line.startswith("| `") and (one := cells(line))}
    for name, *shares in table:
        if name and (RESULTS / name / "opened.json.xz").exists():
            assert said[name][2:] == shares, name
        elif name.startswith("`"):
            assert said[name.strip("`")] == [name, *shares]


def score_of(suite: Path) -> dict[str, list[str]]:
    """What a suite's score says of all cases and of the worst class of forms, row by row."""
    score = (suite / "score.md").read_text().split("## ertskin")[1].split("Maps judged")[0].splitlines()
    return {line[0]: line[2:] for line in map(cells, score) if len(line) == 4}


def test_the_page_s_columns_are_the_whole_suites_scores(table: list[list[str]]) -> None:
    last, before = map(score_of, SUITES)
    said = (CONCEALED / "README.md").read_text().replace("*", "")
    assert all(f"`{one.name}`" in said for one in SUITES)
    together = {line[0]: (line[2], line[3]) for line in table if len(line) == 4 and " (" in line[2]}
    assert len(together) == 10
    for label, (all_samples, recent) in together.items():
        total, worst = last[label]
        assert f"| {total} | {worst} | {before[label][0]} | {recent} | {all_samples} |" in said, label


@pytest.mark.parametrize("opened_whole", SUITES, ids=lambda one: one.name)
def test_a_suite_s_score_comes_out_again(opened_whole: Path, tmp_path: Path) -> None:
    again = tmp_path / opened_whole.name
    shutil.copytree(opened_whole, again)
    (again / "score.md").unlink()
    command = [sys.executable, str(CONCEALED / "proof/score.py"), str(again)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (again / "score.md").read_text() == (opened_whole / "score.md").read_text()


def test_the_last_samples_are_as_many_as_a_suite_has_cases(table: list[list[str]]) -> None:
    ordered = [name for name, *_ in table if name and (RESULTS / name / "opened.json.xz").exists()]
    counts = [len(seals.read_json(RESULTS / name / "opened.json.xz")["cases"]) for name in ordered]
    enough = next(k for k in range(1, len(counts) + 1) if sum(counts[-k:]) >= 300)
    head = (RESULTS / "track_record.md").read_text().split("| together |")[1].splitlines()[0]
    assert head.strip(" |") == f"the last {enough} ({sum(counts[-enough:])} cases)"


def test_an_effect_counts_where_it_is_told_and_apart_where_it_is_misplaced_or_absent() -> None:
    def case(hidden: dict[str, float], channel: int, *said: str) -> Judged:
        effects = [{"name": n, "own": own, "listed": True, "details": {"channel": 3}} for n, own in hidden.items()]
        claims = [{"name": n, "confidence": 0.9, "parameters": {"channel": {"value": channel}}} for n in said]
        kind = "single" if len(hidden) == 1 else "compound" if hidden else "null"
        return Judged("c000", {"kind": kind, "effects": effects}, {"verdict": "explained", "effects": claims})

    both = {"channel_gain": 2.0, "crosstalk": 2.0}
    told, elsewhere = case({"channel_gain": 2.0}, 3, "channel_gain"), case({"channel_gain": 2.0}, 4, "channel_gain")
    small, absent = case({"channel_gain": 1.0}, 3, "channel_gain"), case({}, 3, "channel_gain")
    gain, other = found([told, elsewhere, small, absent, case(both, 3, "channel_gain")])
    assert (gain.name, gain.alone, gain.compound) == ("channel_gain", Share(1.0, 2), Share(1.0, 1))
    assert (gain.misplaced, gain.absent, gain.either) == (1, 1, Share(2.0, 3))
    assert (other.name, other.either, other.absent) == ("crosstalk", Share(0.0, 1), 0)


def test_a_sample_whose_seal_is_broken_is_refused(tmp_path: Path) -> None:
    changed = tmp_path / SAMPLES[0].name
    shutil.copytree(SAMPLES[0], changed)
    opened = seals.read_json(changed / "opened.json.xz")
    opened["cases"][sorted(opened["cases"])[0]]["truth"]["noise_v"] = 9e-3
    seals.write_json(changed / "opened.json.xz", opened)
    done = track_record([changed], tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "track_record.md").exists()


def final_run(split: dict[str, Any], out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = out.with_name("split.json")
    path.write_text(json.dumps(split))
    monkeypatch.setattr(suite, "SPLIT", path)
    monkeypatch.setattr("sys.argv", ["record.py", str(out), "--final", "--only", "c999"])
    with pytest.raises(SystemExit):
        record.main()


def test_no_last_run_is_made_once_all_sealed_families_are_spent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn = suite.whole_split()
    final_run({**drawn, "spent": {"seed1": drawn["sealed"]}}, tmp_path / "suite", monkeypatch)
    assert "no family is sealed any longer" in capsys.readouterr().err.splitlines()[-1]
    assert not (tmp_path / "suite").exists()


def test_a_last_run_has_the_families_sealed_since_the_one_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second, third = (suite.draw_split(seed)["sealed"] for seed in suite.BATCHES)
    spent = {"final310": first, "final314": second}
    final_run({**suite.whole_split(), "spent": spent}, tmp_path / "suite", monkeypatch)
    assert suite.families(final=True) == third
    # 112 nulls, 132 single effects, 40 compounds, and every family at two ratios.
    assert f"in this suite of {284 + 2 * len(third)}" in capsys.readouterr().err.splitlines()[-1]
