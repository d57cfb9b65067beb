"""Rules of the search switched off one by one: each stands where the table says, and comes back."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "experiments" / "concealed"))

import ablation
from ablation import RULES, Count, Judged, of_reasons, table, without


def resolved(place: str) -> Any:
    """What stands at a dotted place."""
    parts = place.split(".")
    for count in range(len(parts), 0, -1):
        try:
            found = import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            found = getattr(found, part)
        return found
    raise AssertionError(place)


@pytest.mark.parametrize("rule", RULES)
def test_a_rule_is_switched_off_and_on_again(rule: str) -> None:
    before = [resolved(place) for place in RULES[rule].where]
    with without(rule):
        assert all(resolved(place) is RULES[rule].instead for place in RULES[rule].where)
    assert [resolved(place) for place in RULES[rule].where] == before


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
    text = table(tmp_path / "out", tmp_path, recordings, ["freed", "foretold"])
    assert "`freed`" in text
    assert "1.010" in text
    assert "foretold" not in text
    monkeypatch.setattr(ablation, "diagnose", lambda *given: pytest.fail("diagnosed again"))
    ablation.answer(recordings[0], "freed", tmp_path / "out")
