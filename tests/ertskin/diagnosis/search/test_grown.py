"""How many terms a search comes to."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from ertskin.diagnosis.recording.work import MOST, Work
from ertskin.diagnosis.search import selection


def fit_of(terms: int, work: Work | None = None) -> Any:
    evidence = SimpleNamespace(work=work or Work())
    solved = SimpleNamespace(terms=[SimpleNamespace(name=str(k)) for k in range(terms)])
    return SimpleNamespace(problem=SimpleNamespace(evidence=evidence), solved=solved)


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> selection._Search:
    """One that finds a term more every time, of a fifth of the work a recording may take."""

    def one_more(search: selection._Search, fit: Any) -> Any:
        fit.problem.evidence.work.add(int(MOST / 5))
        return fit_of(len(fit.solved.terms) + 1, fit.problem.evidence.work)

    monkeypatch.setattr(selection, "rms_of", lambda solved: 2.0)
    monkeypatch.setattr(selection._Search, "one_more", one_more)
    monkeypatch.setattr(selection._Search, "_where_readings_remember", lambda search, fit: fit)
    monkeypatch.setattr(selection._Search, "_without_drifts", lambda search, fit: fit)
    return selection._Search(None, [], lambda share, text: None, 0, {})  # type: ignore[arg-type]


@pytest.mark.parametrize(("begun", "fixed"), [(0, 0), (4, 0), (7, 3), (8, 1)])
def test_terms_of_another_signal_count_among_those_searched_for(
    begun: int, fixed: int, search: selection._Search
) -> None:
    search.fixed = fixed
    fit = fit_of(begun)
    assert len(search.grown(fit).solved.terms) == max(begun + 1, fixed + selection.MOST_TERMS)
    assert not fit.problem.evidence.work.has_ended


@pytest.mark.parametrize(("before", "found"), [(0.3, 4), (0.5, 3), (1.0, 1)])
def test_a_search_ends_where_the_work_is_spent_but_asks_once(
    before: float, found: int, search: selection._Search
) -> None:
    fit = fit_of(0, Work(before * MOST))
    assert len(search.grown(fit).solved.terms) == found
    assert fit.problem.evidence.work.has_ended
