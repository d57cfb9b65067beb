"""Missed skins diagnosed with the hidden names alone, by what is committed."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from given_names import given, missed, row
from judged import Judged

from ertskin.diagnosis.force import fit as force_fit
from ertskin.diagnosis.search import candidates
from ertskin.physics.effects.hypothesis import Signal

CONCEALED = Path(__file__).parents[2] / "experiments/concealed"


def hidden(name: str, form: str) -> dict[str, object]:
    return {"name": name, "form": form, "own": 1.5, "details": {}, "meaning": {}, "listed": True}


def case(kind: str, claims: list[dict[str, object]]) -> Judged:
    effects = [hidden("piezo_creep", "burgers"), hidden("crosstalk", "rc")][: 2 if kind == "compound" else 1]
    truth = {"kind": kind, "effects": effects, "point_m": [[0.0, 0.0]], "presses": 9}
    return Judged("c007", truth, {"verdict": "explained", "effects": claims, "held_out": {"ratio_after": 1.02}})


CREEP, LOOP = ({"name": name, "confidence": 0.8} for name in ("piezo_creep", "piezo_hysteresis"))


def test_single_effects_and_compounds_are_missed_by_their_own_counts_and_nothing_else_is() -> None:
    assert not missed(case("single", [CREEP]))
    assert missed(case("single", [LOOP]))
    assert missed(case("compound", [CREEP]))
    assert not missed(case("null", [LOOP]))


def test_names_not_given_are_shown_by_no_signal() -> None:
    before = candidates.effects_shown_by(Signal.READINGS)
    with given(["piezo_creep", "nonlinear_foam"]):
        assert [kind.name for kind in candidates.effects_shown_by(Signal.READINGS)] == ["piezo_creep"]
        assert [kind.name for kind in force_fit.effects_shown_by(Signal.FORCE)] == ["nonlinear_foam"]
    assert candidates.effects_shown_by(Signal.READINGS) == before
    assert len(before) > 5


@pytest.mark.parametrize(
    ("now", "only", "lost"),
    [([CREEP], None, "right now"), ([LOOP], [CREEP], "the choice"), ([LOOP], [], "even so")],
)
def test_a_row_says_whether_the_choice_of_names_lost_it(
    tmp_path: Path, now: list[dict[str, object]], only: list[dict[str, object]] | None, lost: str
) -> None:
    for name, claims in (("all", now), ("given", only)):
        if claims is not None:
            file = tmp_path / name / "c007/diagnosis.json"
            file.parent.mkdir(parents=True)
            file.write_text(json.dumps(case("single", claims).diagnosis))
    line = row(case("single", [LOOP]), tmp_path, tmp_path)
    assert line.startswith("| c007, 9 | `piezo_creep`/burgers 1.50 | wrong: `piezo_hysteresis` 0.80; 1.020 | ")
    assert line.endswith(f" | {lost} |")


def test_the_command_asks_again_for_what_a_committed_sample_missed(tmp_path: Path) -> None:
    done = {"verdict": "explained", "effects": [{"name": "foam_hysteresis", "confidence": 0.9}]}
    file = tmp_path / "all/c026/diagnosis.json"
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps(done))
    (tmp_path / "c026.h5").touch()
    results = CONCEALED / "results/twentyninth32"
    command = [
        sys.executable,
        CONCEALED / "proof/given_names.py",
        results,
        tmp_path,
        tmp_path,
        "--only",
        "c026",
        "c000",
    ]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    _, _, line = ran.stdout.splitlines()
    assert line.startswith("| c026, 6 | `foam_hysteresis`/energy_unloading 1.15 | `foam_hysteresis` 0.40; 1.019 | ")
    assert line.endswith(" |  | right now |")


@pytest.mark.parametrize(
    ("sample", "says"), [("twentyninth32", "no recording of c002, "), ("nowhere", "found no such file")]
)
def test_what_is_not_there_is_said_in_a_line(tmp_path: Path, sample: str, says: str) -> None:
    results = CONCEALED / "results" / sample
    command = [sys.executable, CONCEALED / "proof/given_names.py", results, tmp_path, tmp_path]
    ran = subprocess.run(command, capture_output=True, text=True)
    assert ran.returncode == 2
    assert says in ran.stderr
    assert len(ran.stderr.splitlines()) == 1
