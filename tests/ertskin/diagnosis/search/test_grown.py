"""How many terms a search comes to."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from ertskin.diagnosis.search import selection


def fit_of(terms: int) -> Any:
    return SimpleNamespace(solved=SimpleNamespace(terms=[SimpleNamespace(name=str(k)) for k in range(terms)]))


@pytest.mark.parametrize(("begun", "fixed"), [(0, 0), (4, 0), (7, 3), (8, 1)])
def test_terms_of_another_signal_count_among_those_searched_for(
    begun: int, fixed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(selection, "rms_of", lambda solved: 2.0)
    monkeypatch.setattr(selection._Search, "one_more", lambda search, fit: fit_of(len(fit.solved.terms) + 1))
    monkeypatch.setattr(selection._Search, "_where_readings_remember", lambda search, fit: fit)
    monkeypatch.setattr(selection._Search, "_without_drifts", lambda search, fit: fit)
    search = selection._Search(None, [], lambda share, text: None, fixed, {})  # type: ignore[arg-type]
    assert len(search.grown(fit_of(begun)).solved.terms) == max(begun + 1, fixed + selection.MOST_TERMS)
