"""Seals that open, and a score recomputed from what is committed alone."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import seals
from generator.families import FAMILIES
from judged import DiagnosisError, Judged, checked
from record import commitments, skin_of, truth_of
from rows import Calibration, FormClasses, Row, Share, calibration_error, calibrations, reliability, rows
from suite import Case, Hidden, suite

# Another study has a module of this name too: the two must not be taken for one another in one run of tests.
SPEC = importlib.util.spec_from_file_location("proof_score", Path(seals.__file__).with_name("score.py"))
assert SPEC is not None
assert SPEC.loader is not None
score = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(score)
SECRET = bytes(range(32))
PINNED_NULLS = "1fc18ecdd5b0252ba42bea6ba5cc6b8dd54251f7723046eb5f31675932bd4eee"
PINNED_GAIN = "9022c4f0bd2b74966da6fd5b5de845b8ab261aebae5341175fc28016d96e7186"
POINTS = [[x, y] for x in (0.0, 0.5, 1.0) for y in (0.0, 0.5, 1.0)]


def effect(name: str, form: str = "f", own: float = 1.5, **details: Any) -> dict[str, Any]:
    return {
        "name": name,
        "form": form,
        "listed": name not in FAMILIES,
        "own": own,
        "details": details,
        "meaning": {"q": 2.0},
    }


def case(
    *effects: dict[str, Any], kind: str = "single", said: list[dict[str, Any]], verdict: str = "explained"
) -> Judged:
    truth = {"kind": kind, "point_m": POINTS, "effects": list(effects)}
    return Judged("c000", truth, {"verdict": verdict, "effects": said, "held_out": {"ratio_after": 1.01}})


def claim(name: str, confidence: float, **more: Any) -> dict[str, Any]:
    return {"name": name, "confidence": confidence, **more}


# --------------------------------------------------------------------------------------------------------- seals


def test_truths_are_rounded_so_that_the_last_bits_of_a_machine_do_not_matter() -> None:
    one, other = {"a": [0.1 + 0.2, 1.0], "b": np.float64(1 / 3)}, {"b": 0.33333331, "a": (0.3, 1)}
    assert seals.canonical(one) == seals.canonical(other)
    assert seals.seal(one, "00" * 32) == "a8a7d270493ff0d2fb3d5bed0c04fc56bfd8d22ca3f72e395ea969928bdfa0e1"
    assert seals.seal(one, "01" * 32) != seals.seal(one, "00" * 32)


def test_a_secret_draws_the_same_suite_truths_and_seals_on_any_machine() -> None:
    cases = suite(SECRET, ["round_tip"], small=True)
    assert [c.name for c in cases] == [f"c{n:03d}" for n in range(len(cases))]
    again = suite(SECRET, ["round_tip"], small=True)
    assert cases == again != suite(bytes(32), ["round_tip"], small=True)
    digest = hashlib.sha256()
    for one in cases:
        if not one.hidden:
            truth, _ = truth_of(one, skin_of(one))
            digest.update(seals.seal(truth, seals.nonce(SECRET, one.name)).encode())
    assert digest.hexdigest() == PINNED_NULLS


def test_a_hidden_effect_is_regenerated_to_the_same_seal() -> None:
    one = Case(
        "c001", "single", 7, "square16", "neoprene", "adjacent", 6, (Hidden("channel_gain", "gain_and_offset", 1.5),)
    )
    truth, effects = truth_of(one, skin_of(one))
    assert truth["effects"][0]["own"] == pytest.approx(1.5, abs=0.1)
    assert effects[0].size == truth["effects"][0]["size"]
    assert seals.seal(truth, seals.nonce(SECRET, "c001")) == PINNED_GAIN


def test_a_whole_suite_covers_what_it_should() -> None:
    cases = suite(SECRET, ["round_tip", "opening_cut"])
    nulls = [c for c in cases if not c.hidden]
    assert len(nulls) >= 100
    assert {c.kind for c in nulls} == {"null", "null_coloured", "null_wrong_guesses", "null_odd_specimen", "null_noisy"}
    assert {c.scan for c in cases} == {"full", "adjacent", "sparse"}
    assert {c.presses for c in cases} == {6, 9, 12, 18, 36}
    assert {c.noise_v for c in cases} == {2e-3, 6e-3}
    forms = {(h.name, h.form) for c in cases if c.kind == "single" for h in c.hidden}
    assert len(forms) >= 40


# --------------------------------------------------------------------------------------------------------- claims


def test_a_name_below_a_half_or_at_another_channel_is_not_right() -> None:
    hidden = effect("channel_gain", channel=3)
    right = claim("channel_gain", 0.8, parameters={"channel": {"value": 3}})
    wrong = claim("channel_gain", 0.95, parameters={"channel": {"value": 4}})
    assert case(hidden, said=[right]).first_right == 1.0
    assert case(hidden, said=[{**right, "confidence": 0.49}]).first_right == 0.0
    assert case(hidden, said=[wrong]).first_right == 0.0
    assert case(hidden, said=[wrong]).wrong_confident == ["channel_gain"]
    assert case(hidden, said=[claim("channel_gain", 0.8)]).first_right == 0.0


def test_a_field_must_follow_the_true_one() -> None:
    field = [x + 2 * y for x, y in POINTS]
    hidden = effect("sheet_inhomogeneity", map=field)
    noisy = [v + 0.2 * (-1) ** n for n, v in enumerate(field)]
    flat = [1.0 if n == 4 else 0.0 for n in range(9)]
    for value, right in ((noisy, 1.0), (flat, 0.0), ([-v for v in field], 0.0)):
        said = claim("sheet_inhomogeneity", 0.9, map={"point_m": POINTS, "value": value})
        assert case(hidden, said=[said]).first_right == right
    assert case(hidden, said=[claim("sheet_inhomogeneity", 0.9)]).first_right == 0.0


def test_a_map_may_be_judged_at_the_sensing_points_that_it_says_it_knows() -> None:
    field = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, -0.5, 0.6, -0.6]
    hidden = effect("piezo_inhomogeneity", map=field)

    def right(known: int, where_known: bool, shuffled: bool = False) -> bool:
        value = [v if k < known else 0.0 for k, v in enumerate(reversed(field) if shuffled else field)]
        told = {"point_m": POINTS, "value": value, "determined": [k < known for k in range(len(POINTS))]}
        said = claim("piezo_inhomogeneity", 0.9, map={"point_m": POINTS, "value": value, "taxels": told})
        return replace(case(hidden, said=[said]), where_known=where_known).first_right == 1.0

    assert right(6, where_known=True)
    assert not right(6, where_known=False)
    assert not right(6, where_known=True, shuffled=True)
    assert not right(4, where_known=True)
    assert right(9, where_known=False)


def test_a_map_counts_by_how_sure_it_is_over_the_points_it_is_judged_at() -> None:
    hidden = effect("piezo_inhomogeneity", map=[float(k) for k in range(9)])
    both = claim("piezo_inhomogeneity", 0.7, confidence_everywhere=0.1, name_confidence=0.9)
    of_before = claim("piezo_inhomogeneity", 0.1, name_confidence=0.9)
    for said, everywhere, known in ((both, 0.1, 0.7), (of_before, 0.1, 0.9), (claim("crosstalk", 0.8), 0.8, 0.8)):
        whole = case(hidden, said=[said])
        assert whole.claims[0]["confidence"] == everywhere
        assert replace(whole, where_known=True).claims[0]["confidence"] == known


def test_no_map_follows_a_field_that_is_even_where_it_is_known() -> None:
    value = [1.0, 2.0, 3.0, 4.0, 5.0, 0.0, 0.0, 0.0, 0.0]
    told = {"point_m": POINTS, "value": value, "determined": [k < 5 for k in range(9)]}
    said = claim("piezo_inhomogeneity", 0.9, map={"point_m": POINTS, "value": value, "taxels": told})
    hidden = effect("piezo_inhomogeneity", map=[0.0] * 5 + [1.0, 2.0, 3.0, 4.0])
    assert replace(case(hidden, said=[said]), where_known=True).correlation(said) == 0.0


def test_rows_that_known_places_change_stand_below_the_table() -> None:
    field = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, -0.5, 0.6, -0.6]
    value = [*field[:6], 0.0, 0.0, 0.0]
    told = {"point_m": POINTS, "value": value, "determined": [True] * 6 + [False] * 3}
    said = claim("piezo_inhomogeneity", 0.95, map={"point_m": POINTS, "value": value, "taxels": told})
    told_case = case(effect("piezo_inhomogeneity", map=field), said=[said])
    text, numbers = score.page("ertskin", [told_case], FormClasses({}))
    above, below = text.split("Maps judged at the sensing points")
    assert re.search(r"first name right, own ratio from 1.3 .* 0.0 %", above)
    assert re.search(r"first name right, own ratio from 1.3 .* 100.0 %", below)
    assert numbers["rows"]["first name right, own ratio from 1.3"]["hits"] == 0
    assert "Maps judged" not in score.page("ertskin", [case(said=[])], FormClasses({}))[0]


def test_a_tie_counts_half() -> None:
    hidden = effect("foam_softening")
    tied = claim("foam_softening", 0.5, alternatives=[{"name": "foam_hysteresis", "confidence": 0.5}])
    assert case(hidden, said=[tied]).first_right == 0.5
    assert case(hidden, said=[claim("foam_hysteresis", 0.6), claim("foam_softening", 0.6)]).first_right == 0.5


def test_an_interval_that_is_not_stated_is_a_miss() -> None:
    hidden = effect("piezo_creep")
    inside = claim("piezo_creep", 0.9, quantities={"q": {"value": 2.1, "low": 1.9, "high": 2.3}})
    outside = claim("piezo_creep", 0.9, parameters={"q": {"value": 3.0, "low": 2.5, "high": 3.5}})
    marks = [case(hidden, said=[one]).intervals()[0][2] for one in (inside, outside, claim("piezo_creep", 0.9))]
    assert marks == [True, False, None]


def test_rows_count_by_form_class_and_keep_the_worst_beside_the_mean() -> None:
    classes = FormClasses({"piezo_creep/a": 0.001, "piezo_creep/b": 0.5})
    cases = [case(effect("piezo_creep", "a"), said=[claim("piezo_creep", 0.9)]) for _ in range(3)]
    cases.append(case(effect("piezo_creep", "b"), said=[claim("crosstalk", 0.95)]))
    cases.append(case(kind="null", said=[claim("crosstalk", 0.2)], verdict="unexplained"))
    cases.append(case(effect("round_tip"), kind="family", said=[], verdict="unexplained"))
    table = {row.label: row for row in rows(cases, classes)}
    first = table["first name right, own ratio from 1.3"]
    assert (first.total.hits, first.total.count) == (3, 4)
    assert first.worst == ("different", Share(0.0, 1))
    assert table["confident (0.9) wrong names, all cases"].total == Share(1.0, 6)
    assert table["confident (0.9) wrong names, all cases"].worst == ("different", Share(1.0, 1))
    assert table["false alarms on nulls"].total == Share(1.0, 1)
    assert table["families: unexplained or partly, no wrong name"].total == Share(1.0, 1)


def test_wilson_and_calibration_error() -> None:
    low, high = Share(9, 10).interval or (0.0, 0.0)
    assert (low, high) == (pytest.approx(0.5958, abs=1e-4), pytest.approx(0.9821, abs=1e-4))
    assert Share(0, 100).interval == pytest.approx((0.0, 0.0370), abs=1e-4)
    cases = [case(effect("piezo_creep"), said=[claim("piezo_creep" if n < 7 else "crosstalk", 0.9)]) for n in range(10)]
    assert calibration_error(reliability(cases)) == pytest.approx(0.2)


def test_the_worst_class_of_intervals_is_the_farthest_from_what_they_state() -> None:
    classes = {"same": Share(20.0, 20), "near": Share(17.0, 20), "different": Share(0.0, 0)}
    assert Row("intervals", "", Share(37.0, 40), classes, 0.9).worst == ("same", Share(20.0, 20))
    assert Row("right", "", Share(37.0, 40), classes).worst == ("near", Share(17.0, 20))
    assert Row("wrong", "", Share(37.0, 40), classes, 0.0).worst == ("same", Share(20.0, 20))
    assert Row("of nulls", "", Share(0.0, 2), {}).worst is None


def test_a_name_on_a_null_is_a_false_alarm_whatever_the_verdict() -> None:
    verdicts = ("no_mismatch", "cannot_tell", "explained")
    nulls = [
        case(kind="null", said=[claim("crosstalk", 0.5 if v == "no_mismatch" else 0.4)], verdict=v) for v in verdicts
    ]
    table = {row.label: row for row in rows(nulls, FormClasses({}))}
    assert table["false alarms on nulls"].total == table["the same, null"].total == Share(2.0, 3)


def test_held_out_counts_only_where_every_name_is_right_and_an_unknown_one_is_a_miss() -> None:
    right = case(effect("piezo_creep"), said=[claim("piezo_creep", 0.9)])
    wrong = case(effect("piezo_creep"), said=[claim("crosstalk", 0.9)])
    silent = Judged("c001", right.truth, {**right.diagnosis, "held_out": None})
    row = {row.label: row for row in rows([right, wrong, silent], FormClasses({}))}[
        "held out after at most 1.05, right names"
    ]
    assert row.total == Share(1.0, 2)


def test_calibration_has_its_interval_and_its_form_classes() -> None:
    classes = FormClasses({"piezo_creep/a": 0.001, "piezo_creep/b": 0.5})
    cases = [case(effect("piezo_creep", "a"), said=[claim("piezo_creep", 0.9)]) for _ in range(12)]
    cases += [case(effect("piezo_creep", "b"), said=[claim("crosstalk", 0.9)]) for _ in range(4)]
    cases.append(case(kind="null", said=[], verdict="no_mismatch"))
    found = calibrations(cases, classes)
    assert set(found) == {"all", "same", "different"}
    assert (found["all"].error, found["all"].count) == (pytest.approx(0.15), 16)
    assert found["all"].interval[0] < 0.15 < found["all"].interval[1]
    assert found["different"].error == pytest.approx(0.9)
    assert Calibration.of([cases[-1]]) is None


def test_every_line_has_an_interval_and_the_worst_form_class() -> None:
    classes = FormClasses({"piezo_creep/a": 0.001, "piezo_creep/b": 0.5})
    creep = claim("piezo_creep", 0.9, quantities={"q": {"value": 2.0, "low": 1.9, "high": 2.1}})
    cases = [case(effect("piezo_creep", form, own), said=[creep]) for form in "ab" for own in (1.1, 1.5)]
    cases.append(case(effect("piezo_creep", "b"), effect("crosstalk"), kind="compound", said=[creep]))
    cases += [case(kind="null", said=[], verdict="no_mismatch"), case(effect("round_tip"), kind="family", said=[])]
    text, numbers = score.page("ertskin", cases, classes)
    lines = [line for line in text.splitlines() if line.startswith("| ")][2:]
    assert len(lines) == len(numbers["rows"]) + 1
    without_class = ("false alarms on nulls", "the same, null", "families")
    for line in lines:
        label, _, total, worst = (cell.strip() for cell in line.strip("|").split("|"))
        assert " to " in total
        assert label.startswith(without_class) or re.match("same|different|unmeasured", worst)
    assert all(one["interval"] for row in numbers["rows"].values() for one in row["classes"].values())


def test_a_diagnosis_that_breaks_the_contract_is_refused() -> None:
    with pytest.raises(DiagnosisError, match="format_version"):
        checked("m/c000", {"format": "ertskin-diagnosis", "format_version": 2, "verdict": "explained"})
    assert checked("m/c000", None)["verdict"] == "cannot_tell"


# ------------------------------------------------------------------------------------------------- from the repository


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """A published seed of the small suite's nulls, every one diagnosed."""
    cases = [c for c in suite(SECRET, [], small=True) if not c.hidden]
    for one in cases:
        truth, _ = truth_of(one, skin_of(one))
        seals.write_json(
            tmp_path / "sealed" / f"{one.name}.json", {"truth": truth, "nonce": seals.nonce(SECRET, one.name)}
        )
        (tmp_path / "recordings").mkdir(exist_ok=True)
        (tmp_path / "recordings" / f"{one.name}.h5").write_bytes(one.name.encode())
    committed = commitments(tmp_path, cases, SECRET, {"families": [], "small": True})
    seals.write_json(tmp_path / "commitments.json", committed)
    opened = {c.name: seals.read_json(tmp_path / "sealed" / f"{c.name}.json") for c in cases}
    seals.write_json(tmp_path / "opened.json.xz", {"secret": SECRET.hex(), "cases": opened})
    answer = {"format": "ertskin-diagnosis", "format_version": 1, "verdict": "no_mismatch", "effects": []}
    seals.write_json(tmp_path / "diagnoses.json.xz", {"ertskin": {c.name: answer for c in cases}})
    return tmp_path


def test_the_score_comes_out_of_the_repository_alone(results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["score.py", str(results), "--recordings", str(results / "recordings")])
    assert score.main() == 0
    numbers = json.loads((results / "score.json").read_text())["ertskin"]["rows"]["false alarms on nulls"]
    assert (numbers["hits"], numbers["count"]) == (0, 5)
    assert "0.0 % (0/5" in (results / "score.md").read_text()
    assert (results / "reliability.png").stat().st_size > 1000


@pytest.mark.parametrize("what", ["truth", "secret", "recording", "missing"])
def test_whatever_was_changed_after_the_commitment_is_refused(
    results: Path, what: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened = seals.read_json(results / "opened.json.xz")
    name = sorted(opened["cases"])[0]
    if what == "truth":
        opened["cases"][name]["truth"]["noise_v"] = 9e-3
    elif what == "secret":
        opened["secret"] = bytes(32).hex()
    elif what == "missing":
        del opened["cases"][name]
    else:
        (results / "recordings" / f"{name}.h5").write_bytes(b"other")
    seals.write_json(results / "opened.json.xz", opened)
    monkeypatch.setattr("sys.argv", ["score.py", str(results), "--recordings", str(results / "recordings")])
    assert score.main() == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
