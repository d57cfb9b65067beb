"""A field told place by place enters alone, or with one term more, where they explain most of what is missing."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.full_solution_check import CheckedFit
from ertskin.diagnosis.recording import work
from ertskin.diagnosis.recording.work import Work
from ertskin.diagnosis.search import selection

LOST = 40.0
FORM: Any = "another form of the loop"


def fit_of(misfit: float, *names: str) -> CheckedFit:
    solved: Any = SimpleNamespace(terms=[SimpleNamespace(name=name) for name in names])
    problem: Any = SimpleNamespace(evidence=SimpleNamespace(criteria=DEFAULT, work=Work()))
    return CheckedFit(problem, solved, misfit, 0.0)


@pytest.mark.parametrize(
    ("alone", "with_another", "least", "expected"),
    [
        pytest.param(1.5, None, 0.0, ["field"], id="the field alone"),
        pytest.param(1.5, None, 2 * LOST, None, id="less than an instrument"),
        pytest.param(2.5, 1.2, 0.0, ["field", "loop"], id="both"),
        pytest.param(2.5, 2.4, 0.0, None, id="neither"),
        pytest.param(2.5, None, 0.0, None, id="nothing beside it"),
    ],
)
def test_a_field_enters_with_what_it_hides(
    alone: float, with_another: float | None, least: float, expected: list[str] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def one_more(search: selection._Search, fit: CheckedFit) -> CheckedFit | None:
        assert [term.name for term in fit.solved.terms] == ["field"]
        search.tried.append(selection.Tried(("field", "loop"), 7.0, with_another is not None))
        search.forms.append(FORM)
        return None if with_another is None else fit_of(with_another, "field", "loop")

    monkeypatch.setattr(selection, "with_field_by_place", lambda *given: (fit_of(alone, "field"), LOST))
    monkeypatch.setattr(selection._Search, "one_more", one_more)
    monkeypatch.setattr(selection._Search, "_refined", lambda search, fit: fit)
    search = selection._Search(None, [], lambda share, text: None, 0, {})  # type: ignore[arg-type]
    found = search._with_places_and_another(fit_of(3.0), least)
    assert (None if found is None else [term.name for term in found.solved.terms]) == expected
    kept = [one.effects for one in search.tried if one.kept]
    assert kept == ([] if expected is None else [("field",), ("field", "loop")][: len(expected)])
    # What a field alone gains that comes to nothing would be taken for an effect too small for a name.
    assert ("field",) not in [one.effects for one in search.tried if not one.kept]
    assert (search.forms == [FORM]) is (expected == ["field", "loop"])


@pytest.mark.parametrize(("terms", "spent"), [(5, False), (1, True)], ids=["as many as there may be", "work spent"])
def test_nothing_is_looked_for_beside_a_field_then(terms: int, spent: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(selection, "with_field_by_place", lambda *given: (fit_of(2.5, *["any"] * terms), LOST))
    monkeypatch.setattr(selection._Search, "_refined", lambda search, fit: fit)
    monkeypatch.setattr(work, "MOST", 0.0 if spent else 1.0)
    search = selection._Search(None, [], lambda share, text: None, 0, {})  # type: ignore[arg-type]
    assert search._with_places_and_another(fit_of(3.0), 0.0) is None
    assert search.tried == []
