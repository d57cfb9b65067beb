"""Rules of the search switched off one by one: each stands where the table says, and comes back."""

from __future__ import annotations

import sys
from pathlib import Path
from pkgutil import resolve_name
from types import SimpleNamespace
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "experiments" / "concealed"))

import ablation
from ablation import RULES, Count, Judged, counted, of_acting, of_reasons, table, without


@pytest.mark.parametrize("rule", RULES)
def test_a_rule_is_switched_off_and_on_again(rule: str) -> None:
    before = [resolve_name(place) for place in RULES[rule].where]
    with without(rule):
        assert all(resolve_name(place) is RULES[rule].instead for place in RULES[rule].where)
    assert [resolve_name(place) for place in RULES[rule].where] == before


def case(name: str, hidden: list[str], claimed: dict[str, float], ratio: float = 1.0) -> Judged:
    truth = {"kind": "single", "effects": [{"name": one, "listed": True, "details": {}} for one in hidden]}
    effects = [
        {"name": key, "confidence": value, "reasons": [{"rule": "mending", "before": 0.8, "after": value}]}
        for key, value in claimed.items()
    ]
    said = {"verdict": "explained", "effects": effects, "held_out": {"ratio_after": ratio}, "cpu_s": 2.0}
    return Judged(name, truth, said)


CASES = [case("a", ["piezo_creep"], {"piezo_creep": 0.95}), case("b", [], {"scan_skew": 0.92, "crosstalk": 0.3}, 1.5)]


def test_names_are_counted_at_a_half() -> None:
    assert Count.of(CASES) == Count(1, 1, 1, 1, (1.0, 1.5), 4.0)


def test_what_rules_took_is_counted_by_the_claims_reasons() -> None:
    assert "| `mending` | 1 | 0 | 2 | 1 |" in of_reasons(CASES)


def test_a_rule_has_its_line_once_all_its_recordings_are_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recordings = [Path("a.h5")]
    (tmp_path / "a.json").write_text('{"truth": {"kind": "null", "effects": []}}')
    said = SimpleNamespace(
        as_builtins=lambda: {"verdict": "no_mismatch", "effects": [], "held_out": {"ratio_after": 1.01}}
    )
    monkeypatch.setattr(ablation, "read_recording", lambda path: None)
    monkeypatch.setattr(ablation, "diagnose", lambda *given: SimpleNamespace(diagnosis=said))
    ablation.answer(recordings[0], "freed", tmp_path / "out")
    text = table(tmp_path / "out", tmp_path, recordings, ["freed", "form_error"])
    assert "`freed`" in text
    assert "1.010" in text
    assert "form_error" not in text
    monkeypatch.setattr(ablation, "diagnose", lambda *given: pytest.fail("diagnosed again"))
    ablation.answer(recordings[0], "freed", tmp_path / "out")


def test_a_rule_acts_where_it_says_other_than_what_takes_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    places = [resolve_name(RULES[rule].where[0]) for rule in ("nominal_again", "exchange")]
    from ertskin.diagnosis.search import selection

    monkeypatch.setattr(selection, "reconsidered", lambda build, incumbent: incumbent)
    monkeypatch.setattr(selection, "exchanged", lambda *given: ("term", "fit", 3.0))
    with counted() as acted:
        assert selection.reconsidered(None, "fit") == "fit"  # type: ignore[arg-type, comparison-overlap]
        selection.exchanged(*[None] * 5)  # type: ignore[arg-type]
    assert (acted["nominal_again"], acted["exchange"], acted["freed"]) == (0, 1, 0)
    assert "lower_first" not in acted
    monkeypatch.undo()
    assert [resolve_name(RULES[rule].where[0]) for rule in ("nominal_again", "exchange")] == places


def test_without_a_rule_that_never_acted_nothing_is_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run: list[str] = []

    def diagnosed(recording: Path, rule: str | None) -> dict[str, Any]:
        run.append(str(rule))
        return {"said": str(rule), **({"acted": {"freed": 0, "exchange": 2}} if rule is None else {})}

    monkeypatch.setattr(ablation, "_diagnosed", diagnosed)
    said = [ablation.answer(Path("a.h5"), rule, tmp_path)["said"] for rule in ("freed", "exchange", "lower_first")]
    assert said == ["None", "exchange", "lower_first"]
    assert run == ["None", "exchange", "lower_first"]
    assert "| `exchange` | 2 | 1 of 1 |" in of_acting(tmp_path, [Path("a.h5")])
