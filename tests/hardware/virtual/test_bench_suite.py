"""The concealed study's cases and scores, on diagnoses made up for the purpose."""

import json
import sys
from collections import Counter
from pathlib import Path

import pytest

from ertskin.hardware.virtual.bench import EFFECTS, draw_truth
from ertskin.hardware.virtual.bench.nominal import nominal_sensor
from ertskin.hardware.virtual.bench.sealing import SealError, seal

FOLDER = Path(__file__).parents[3] / "experiments" / "concealed"


@pytest.fixture(autouse=True)
def study(monkeypatch: pytest.MonkeyPatch):
    """The study's scripts import each other as neighbours."""
    monkeypatch.syspath_prepend(str(FOLDER))
    yield
    for name in ("cases", "comparable", "verdicts", "score", "generate", "rerun", "redrawn"):
        sys.modules.pop(name, None)


def hide(out: Path, name: str, kind: str, effects: dict[str, float], diagnosis: dict | None) -> None:
    (out / "recordings").mkdir(parents=True, exist_ok=True)
    truth = draw_truth(nominal_sensor(), 7, effects)
    ratios = {effect: {"own": 1.5} for effect in effects}
    seal(out / "recordings" / f"{name}.h5", truth, out / "sealed", {"kind": kind, "plan": "quick", "ratios": ratios})
    if diagnosis is not None:
        folder = out / "diagnoses" / "ours" / name
        folder.mkdir(parents=True)
        (folder / "diagnosis.json").write_text(
            json.dumps({"format": "ertskin-diagnosis", "format_version": 1, **diagnosis})
        )


def named(*claims: tuple[str, float], verdict: str = "explained", **more: object) -> dict:
    return {"verdict": verdict, "effects": [{"name": name, "confidence": c} for name, c in claims], **more}


def test_suite_holds_every_class_and_names_tell_nothing():
    from cases import LISTED, suite

    cases = suite(1, small=False)
    count = Counter(case.kind for case in cases)
    assert count["null"] + count["null_coloured"] + count["null_wrong_guesses"] >= 60
    assert {name for case in cases if case.kind == "single" for name in case.ratios} == set(LISTED)
    assert {name for case in cases if case.kind == "unlisted" for name in case.ratios} == set(EFFECTS) - set(LISTED)
    assert {len(case.ratios) for case in cases if case.kind == "compound"} == {2, 3}
    assert len({case.name for case in cases}) == len({case.seed for case in cases}) == len(cases)
    assert [case.kind for case in cases] != sorted(case.kind for case in cases)
    assert suite(1, small=False) == cases != suite(2, small=False)
    assert len(suite(1, small=True)) < 20


def test_right_and_wrong_claims_are_counted(tmp_path: Path):
    from score import markdown, score
    from verdicts import open_case

    hide(tmp_path, "c0", "null", {}, {"verdict": "no_mismatch", "effects": []})
    hide(tmp_path, "c1", "null", {}, named(("piezo_creep", 0.95)))
    hide(tmp_path, "c2", "single", {"crosstalk": 1.0}, named(("crosstalk", 0.9), held_out={"ratio_after": 1.01}))
    hide(tmp_path, "c3", "single", {"piezo_creep": 1.0}, named(("temperature_drift", 0.5)))
    hide(tmp_path, "c4", "unlisted", {"mains_hum": 1.0}, {"verdict": "unexplained", "effects": []})
    both = named(("crosstalk", 0.9), ("scan_skew", 0.8), held_out={"ratio_after": 1.2})
    hide(tmp_path, "c5", "compound", {"crosstalk": 1.0, "scan_skew": 1.0}, both)
    hide(tmp_path, "c6", "null", {}, None)
    cases = [case for case in (open_case(f"c{number}", tmp_path, "ours") for number in range(7)) if case]
    result = score(cases, 7)
    assert result["cases"] == "6/7"
    assert result["confident_wrong"] == {"c1": ["piezo_creep"]}
    assert (result["false_alarms"]["hits"], result["false_alarms"]["count"]) == (1, 2)
    assert result["top_one"]["1.3 to 2"]["share"] == 0.5
    assert result["all_found"]["share"] == 1.0
    assert result["unlisted_unexplained"]["share"] == 1.0
    assert result["ratio_after_low"]["share"] == 0.5
    assert result["confusion"]["null"] == {"no_mismatch": 1, "piezo_creep": 1}
    assert result["abstention"]["hits"] == 1
    page = markdown({"ours": result})
    assert page.index("ours, c1: piezo_creep") < page.index("## Table")


def test_places_electrodes_and_intervals_are_held_to_the_truth(tmp_path: Path):
    from score import score
    from verdicts import open_case

    hidden = draw_truth(nominal_sensor(), 7, {"channel_gain": 1.0}).effects["channel_gain"]["parameters"]
    gain = hidden["gain"]
    claim = {"value": 1.1 * gain, "low": min(0.9 * gain, 1.2 * gain), "high": max(0.9 * gain, 1.2 * gain)}
    right = named(("channel_gain", 0.9), where={"electrodes": [hidden["channel"]]})
    right["effects"][0]["parameters"] = {"gain": claim}
    hide(tmp_path, "c0", "single", {"channel_gain": 1.0}, right)
    spot = draw_truth(nominal_sensor(), 7, {"torn_patch": 1.0}).effects["torn_patch"]["parameters"]["center_m"]
    near = {"verdict": "unexplained", "where": {"position_m": [spot[0] + 3e-3, spot[1] + 4e-3]}}
    hide(tmp_path, "c1", "unlisted", {"torn_patch": 1.0}, near)
    cases = [case for case in (open_case(f"c{number}", tmp_path, "ours") for number in range(2)) if case]
    result = score(cases, 2)
    assert result["electrode"]["f1"] == 1.0
    assert result["distance_m"] == pytest.approx(5e-3)
    assert result["parameters"]["coverage"] == 1.0
    assert result["parameters"]["median_error"] == pytest.approx(0.1)


def test_the_right_name_at_the_wrong_channel_is_wrong(tmp_path: Path):
    from score import score
    from verdicts import open_case

    channel = draw_truth(nominal_sensor(), 7, {"channel_gain": 1.0}).effects["channel_gain"]["parameters"]["channel"]
    near = named(("channel_gain", 0.95))
    near["effects"][0]["parameters"] = {"channel": {"value": (channel + 1) % 24}}
    hide(tmp_path, "c0", "single", {"channel_gain": 1.0}, near)
    result = score([open_case("c0", tmp_path, "ours")], 1)
    assert result["confident_wrong"] == {"c0": ["channel_gain"]}
    assert result["top_one"]["1.3 to 2"]["share"] == 0.0
    assert result["likely_right"]["share"] == 0.0


def test_a_method_that_gave_no_answer_has_named_nothing(tmp_path: Path):
    from score import score
    from verdicts import open_case

    hide(tmp_path, "c0", "single", {"crosstalk": 1.0}, None)
    assert open_case("c0", tmp_path, "ours") is None
    (tmp_path / "diagnoses" / "ours" / "c0").mkdir(parents=True)
    result = score([open_case("c0", tmp_path, "ours")], 1)
    assert result["top_one"]["1.3 to 2"] == {
        "hits": 0,
        "count": 1,
        "share": 0.0,
        "low": 0.0,
        "high": pytest.approx(0.975),
    }


def test_a_folder_takes_cases_of_one_suite_only(tmp_path: Path):
    from cases import suite
    from generate import generate

    cases = suite(1, small=True)
    assert list(generate([], tmp_path, 1)) == []
    (tmp_path / "cases.json").write_text(json.dumps({cases[0].name: [cases[0].seed, cases[0].kind, "another"]}))
    with pytest.raises(SystemExit, match="use another folder"):
        list(generate(cases, tmp_path, 1))


def test_a_diagnosis_that_breaks_the_contract_is_refused(tmp_path: Path):
    from verdicts import DiagnosisError, open_case

    hide(tmp_path, "c0", "null", {}, {"verdict": "all is well"})
    with pytest.raises(DiagnosisError, match="all is well"):
        open_case("c0", tmp_path, "ours")


def test_truths_are_not_opened_when_they_were_changed(tmp_path: Path):
    from verdicts import open_case

    hide(tmp_path, "c0", "null", {}, {"verdict": "no_mismatch"})
    hidden = tmp_path / "sealed" / "c0.truth.json"
    hidden.write_text(hidden.read_text().replace("null", "pair"))
    with pytest.raises(SealError):
        open_case("c0", tmp_path, "ours")


def test_truths_drawn_again_are_held_to_their_seals(tmp_path: Path, monkeypatch, capsys):
    import redrawn
    from cases import suite
    from generate import draw

    from ertskin.hardware.virtual.bench.sealing import commitment, to_seal

    first, second, *_ = [case for case in suite(3, False) if not case.ratios]
    nonce, text = to_seal(*draw(first))
    older = json.loads(text)
    for name in redrawn.SINCE:
        del older["truth"]["noise"][name]
    seals = tmp_path / "seals.json"
    monkeypatch.setattr("sys.argv", ["redrawn.py", str(seals), "--seed", "3"])
    for published in (text, json.dumps(older, sort_keys=True)):
        seals.write_text(json.dumps({first.name: commitment(nonce, published)}))
        assert redrawn.main() == 0
    seals.write_text(json.dumps({first.name: commitment(nonce, text), second.name: commitment(nonce, text)}))
    assert redrawn.main() == 1
    assert f"1 of 2 seals met; not {second.name}" in capsys.readouterr().out


def test_a_method_is_run_once_for_each_recording(tmp_path: Path):
    from rerun import Method, cluster_of, diagnose_all

    hide(tmp_path, "c0", "null", {}, None)
    method = Method.parse("echo=bash -c 'echo {recording} > {out}/diagnosis.json'")
    cluster = cluster_of("local", "workers=1")
    assert list(diagnose_all([method], ["c0"], tmp_path, cluster)) == ["echo c0: diagnosed"]
    assert list(diagnose_all([method], ["c0"], tmp_path, cluster)) == []
