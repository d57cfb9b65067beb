"""A form that explained nearly as much as the one that entered is gone on with where a mismatch stays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import pytest

from ertskin.diagnosis.contract.claims import Rival
from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.full_solution_check import CheckedFit
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search import other_forms as module
from ertskin.diagnosis.search import selection
from ertskin.diagnosis.search.chosen import key_of
from ertskin.diagnosis.search.other_forms import begun_anew, other_forms
from ertskin.diagnosis.search.trials import Trial
from ertskin.physics.effects.contact_pressure_dependence import ContactPressureDependence
from ertskin.physics.effects.indenter_offset import IndenterOffset

ALIKE = Term(ContactPressureDependence(evenly=True), ("sensitivity_per_pa",))
UNEVEN = replace(ALIKE, effect=ContactPressureDependence(evenly=False))
OFFSET = Term(IndenterOffset(), ("dx_m",))


@dataclass(frozen=True)
class Modes:
    """A smooth field's, as far as it is one."""


def trial(term: Term, gain: float) -> Trial:
    return Trial(term, gain, SimpleNamespace(terms=(term,)))  # type: ignore[arg-type]


def fit_of(*terms: Term, misfit: float = 1.6) -> CheckedFit:
    problem: Any = SimpleNamespace(evidence=SimpleNamespace(criteria=DEFAULT), at_hand=lambda solved: solved)
    return CheckedFit(problem, SimpleNamespace(terms=terms), misfit, 0.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("other", "kept"),
    [
        (trial(UNEVEN, 95.0), True),
        (trial(UNEVEN, 80.0), False),
        (trial(ALIKE, 95.0), False),
        (trial(OFFSET, 95.0), False),
        (trial(replace(UNEVEN, modes=Modes()), 95.0), False),  # type: ignore[arg-type]
    ],
    ids=["another form", "one that gains less", "the same form", "another name", "a smooth field"],
)
def test_forms_that_gain_nearly_as_much_are_kept(other: Trial, kept: bool) -> None:
    entered = trial(ALIKE, 100.0)
    assert other_forms(entered, [entered, other]) == ([other] if kept else [])


def test_a_smooth_field_has_no_other_form() -> None:
    entered = trial(replace(ALIKE, modes=Modes()), 100.0)  # type: ignore[arg-type]
    assert other_forms(entered, [entered, trial(UNEVEN, 99.0)]) == []


@pytest.mark.parametrize(
    ("expected", "fixed", "begun"),
    [(400.0, 0, True), (200.0, 0, False), (400.0, 1, False)],
    ids=["promises enough", "promises too little", "other terms are fixed by now"],
)
def test_it_is_begun_anew_only_where_that_may_be_likelier(
    expected: float, fixed: int, begun: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Alone the form is less likely by 300 than all that was found beside the other one.
    incumbent = fit_of(OFFSET, ALIKE)
    monkeypatch.setattr(module, "where_it_settles", lambda build, problem, solved: fit_of(*solved.terms))
    monkeypatch.setattr(module, "unlikely", lambda solved: 900.0 if len(solved.terms) == 2 else 1200.0)
    monkeypatch.setattr(module, "screen", lambda *given: [SimpleNamespace(gain=expected), SimpleNamespace(gain=1.0)])
    found = begun_anew(None, incumbent, trial(UNEVEN, 95.0), fixed, [])  # type: ignore[arg-type]
    assert (found is not None) is begun
    assert found is None or found.solved.terms == (UNEVEN,)


@pytest.mark.parametrize(
    ("misfit", "gain", "names"),
    [(1.6, 5000.0, [UNEVEN, OFFSET]), (1.6, 3.0, [ALIKE]), (1.04, 5000.0, [ALIKE])],
    ids=["likelier", "not likelier", "nothing is missing"],
)
def test_what_follows_is_kept_where_a_mismatch_stays_and_it_is_likelier(
    misfit: float, gain: float, names: list[Term], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(selection, "begun_anew", lambda build, incumbent, form, fixed, folds: fit_of(form.term))
    monkeypatch.setattr(selection._Search, "grown", lambda search, fit: fit_of(*fit.solved.terms, OFFSET))
    monkeypatch.setattr(selection._Search, "pruned", lambda search, fit: (tuple(fit.solved.terms), fit))
    monkeypatch.setattr(selection, "gain_of_exchange", lambda incumbent, reached: gain)
    monkeypatch.setattr(selection, "worth_a_name", lambda problem, solved: 600.0)
    search = selection._Search(None, [], lambda share, text: None, 0, {})  # type: ignore[arg-type]
    rivals = (Rival(OFFSET.effect, 7.0),)
    search.forms = [(trial(UNEVEN, 95.0), rivals)]
    chosen: Any = (ALIKE,)
    found, reached = search.with_other_forms(chosen, fit_of(ALIKE, misfit=misfit))
    assert list(found) == list(reached.solved.terms) == names
    kept = len(names) == 2
    assert [(one.effects, one.gain, one.kept) for one in search.tried] == (
        [((UNEVEN.name, OFFSET.name), gain, kept)] if misfit > DEFAULT.mismatch_ratio else []
    )
    assert search.stand == ({key_of(UNEVEN): rivals} if kept else {})
    assert search.forms == []
