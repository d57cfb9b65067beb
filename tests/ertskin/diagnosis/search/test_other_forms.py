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
from ertskin.diagnosis.recording import work
from ertskin.diagnosis.recording.work import Work
from ertskin.diagnosis.search import other_forms as module
from ertskin.diagnosis.search import selection
from ertskin.diagnosis.search.chosen import key_of
from ertskin.diagnosis.search.other_forms import OtherForm, may_be_likelier, other_forms
from ertskin.diagnosis.search.trials import Trial
from ertskin.physics.effects.contact_pressure_dependence import ContactPressureDependence
from ertskin.physics.effects.indenter_offset import IndenterOffset
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity

ALIKE = Term(ContactPressureDependence(evenly=True), ("sensitivity_per_pa",))
UNEVEN = replace(ALIKE, effect=ContactPressureDependence(evenly=False))
OFFSET = Term(IndenterOffset(), ("dx_m",))
RIVALS = (Rival(OFFSET.effect, 7.0),)


@dataclass(frozen=True)
class Modes:
    """A smooth field's, as far as it is one."""


SPOT = Term(SheetInhomogeneity(), ("amplitude",))
FIELD = replace(SPOT, modes=Modes())  # type: ignore[arg-type]
OTHER_FIELD = replace(FIELD, effect=PiezoInhomogeneity())


def trial(term: Term, gain: float) -> Trial:
    return Trial(term, gain, SimpleNamespace(terms=(term,)))  # type: ignore[arg-type]


FORM = OtherForm(trial(UNEVEN, 95.0), RIVALS, 0)


def fit_of(*terms: Term, misfit: float = 1.6) -> CheckedFit:
    evidence = SimpleNamespace(criteria=DEFAULT, work=Work())
    problem: Any = SimpleNamespace(evidence=evidence, specimen=None, at_hand=lambda solved: solved)
    return CheckedFit(problem, SimpleNamespace(terms=terms, effects=()), misfit, 0.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("others", "kept"),
    [
        ([trial(UNEVEN, 95.0)], [0]),
        ([trial(UNEVEN, 80.0)], []),
        ([trial(replace(ALIKE, free=("sensitivity_per_pa", "bend")), 95.0)], []),
        ([trial(OFFSET, 95.0)], []),
        ([trial(replace(UNEVEN, modes=Modes()), 95.0)], []),  # type: ignore[arg-type]
        ([trial(UNEVEN, 96.0), trial(UNEVEN, 95.0)], [0]),
    ],
    ids=["another law", "one that gains less", "the same law", "another name", "a smooth field", "two of a law"],
)
def test_the_best_of_every_law_that_gains_nearly_as_much_is_kept(others: list[Trial], kept: list[int]) -> None:
    entered, rivals = trial(ALIKE, 100.0), (Rival(OFFSET.effect, 2.0),)
    found = other_forms(entered, [entered, *others], rivals, 3)
    assert [one.trial for one in found] == [others[k] for k in kept]
    assert all((one.rivals, one.fixed) == (rivals, 3) for one in found)


def test_what_is_there_already_does_not_come_before_a_field_once_more() -> None:
    entered, there = trial(FIELD, 100.0), trial(OFFSET, 80.0)
    entered.solved.terms = (OFFSET, FIELD)  # type: ignore[misc]
    found = other_forms(entered, [entered, there, trial(UNEVEN, 40.0)], (), 0)
    assert [one.trial.term for one in found] == [UNEVEN]


@pytest.mark.parametrize(
    ("others", "kept"),
    [
        ([trial(UNEVEN, 40.0), trial(ALIKE, 45.0), trial(OFFSET, 20.0)], [1]),
        ([trial(OFFSET, 20.0)], []),
        ([trial(SPOT, 90.0)], []),
        ([trial(OTHER_FIELD, 90.0)], []),
    ],
    ids=["the best", "one that gains too little", "a spot", "another smooth field"],
)
def test_before_a_smooth_field_may_come_the_best_of_few_numbers_that_gains_enough(
    others: list[Trial], kept: list[int]
) -> None:
    entered = trial(FIELD, 100.0)
    found = other_forms(entered, [entered, *others], (), 3)
    assert [(one.trial, one.field, one.fixed) for one in found] == [(others[k], FIELD, 3) for k in kept]
    for one in found:
        assert [(rival.effect, rival.short) for rival in one.rivals] == [(OFFSET.effect, 25.0)]


@pytest.mark.parametrize(
    ("terms", "fixed", "may"),
    [((FIELD,), 0, True), ((SPOT,), 0, False), ((FIELD, UNEVEN), 0, False), ((FIELD,), 1, False)],
    ids=["there", "dropped", "both there", "others are fixed by now"],
)
def test_it_may_come_before_a_field_that_is_there(terms: tuple[Term, ...], fixed: int, may: bool) -> None:
    assert OtherForm(trial(ALIKE, 95.0), (), 0, FIELD).may_replace(terms, fixed) is may


@pytest.mark.parametrize("may", [True, False])
def test_before_a_field_it_may_be_likelier_where_one_beside_it_is(may: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def promises(incumbent: CheckedFit, fit: CheckedFit, field: Term, partitions: list[list[int]]) -> bool:
        asked.append(field)
        return may

    monkeypatch.setattr(module, "promises", promises)
    form = replace(FORM, field=FIELD)
    assert may_be_likelier(fit_of(UNEVEN), fit_of(FIELD), form, 600.0, []) is may
    assert asked == [FIELD]


@pytest.mark.parametrize(
    ("terms", "fixed", "may"),
    [((ALIKE, OFFSET), 0, True), ((UNEVEN, OFFSET), 0, False), ((OFFSET,), 0, False), ((ALIKE, OFFSET), 1, False)],
    ids=["there in another form", "there in this form", "dropped", "others are fixed by now"],
)
def test_it_may_replace_its_effect_in_another_form(terms: tuple[Term, ...], fixed: int, may: bool) -> None:
    assert OtherForm(trial(UNEVEN, 95.0), (), 0).may_replace(terms, fixed) is may


@pytest.mark.parametrize(("expected", "may"), [(1000.0, True), (800.0, False)])
def test_it_may_be_likelier_where_a_candidate_promises_it(
    expected: float, may: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Alone the form is less likely by 300 than all that was found beside the other one, and 600 is worth a name.
    monkeypatch.setattr(module, "gain_of_exchange", lambda present, proposed: -300.0)
    monkeypatch.setattr(module, "screen", lambda *given: [SimpleNamespace(gain=expected), SimpleNamespace(gain=1.0)])
    assert may_be_likelier(fit_of(UNEVEN), fit_of(ALIKE, OFFSET), FORM, 600.0, []) is may


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> selection._Search:
    """One to which an offset enters beside what is there, of whose term another form is known."""
    monkeypatch.setattr(selection, "where_it_settles", lambda build, problem, solved: fit_of(*solved.terms))
    monkeypatch.setattr(selection, "refined", lambda build, fit, partitions, free: fit)
    monkeypatch.setattr(selection, "reconsidered", lambda build, fit: fit)
    monkeypatch.setattr(selection, "worth_a_name", lambda problem, solved: 600.0)
    monkeypatch.setattr(selection, "may_be_likelier", lambda fit, incumbent, form, least, partitions: True)
    monkeypatch.setattr(selection._Search, "_without_drifts", lambda search, fit: fit)
    monkeypatch.setattr(
        selection._Search, "grown", lambda search, fit, *until: fit_of(*fit.solved.terms, OFFSET, misfit=1.0)
    )
    monkeypatch.setattr(selection._Search, "pruned", lambda search, fit: (tuple(fit.solved.terms), fit))
    monkeypatch.setattr(selection, "gain_of_exchange", lambda incumbent, reached: 5000.0)
    found = selection._Search(None, [], lambda share, text: None, 0, {})  # type: ignore[arg-type]
    found.forms = [FORM]
    return found


def gone_on(search: selection._Search, misfit: float = 1.6) -> list[Term]:
    """The terms that a search ends with which has found one so far."""
    chosen: Any = (ALIKE,)
    found, reached = search.with_other_forms(chosen, fit_of(ALIKE, misfit=misfit))
    assert list(found) == list(reached.solved.terms)
    assert search.forms == []
    return list(reached.solved.terms)


def test_what_follows_another_form_is_kept_where_it_is_likelier(search: selection._Search) -> None:
    assert gone_on(search) == [UNEVEN, OFFSET]
    assert search.stand == {key_of(UNEVEN): RIVALS}
    assert [(one.effects, one.gain, one.kept) for one in search.tried] == [((UNEVEN.name, OFFSET.name), 5000.0, True)]


def test_nothing_is_gone_on_with_once_the_work_is_spent(
    search: selection._Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(work, "MOST", 0.0)
    assert gone_on(search) == [ALIKE]
    assert search.tried == []


def test_it_is_tried_and_left_where_it_is_not_likelier(
    search: selection._Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(selection, "gain_of_exchange", lambda incumbent, reached: 590.0)
    assert gone_on(search) == [ALIKE]
    assert search.stand == {}
    assert [one.kept for one in search.tried] == [False]


def test_it_is_left_where_frames_solved_in_full_fit_worse(
    search: selection._Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(selection._Search, "grown", lambda search, fit, *until: fit_of(*fit.solved.terms, misfit=9.0))
    assert gone_on(search) == [ALIKE]


def test_it_is_left_where_the_specimen_comes_to_disagree(
    search: selection._Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    def grown(other: selection._Search, fit: CheckedFit, *until: object) -> CheckedFit:
        other.disagrees = True
        return fit_of(*fit.solved.terms, OFFSET, misfit=1.0)

    monkeypatch.setattr(selection._Search, "grown", grown)
    assert gone_on(search) == [ALIKE]
    assert not search.disagrees


@pytest.mark.parametrize(("misfit", "fixed", "promising"), [(1.04, 0, True), (1.6, 1, True), (1.6, 0, False)])
def test_it_is_not_tried_where_nothing_is_missing_others_are_fixed_or_it_promises_nothing(
    misfit: float, fixed: int, promising: bool, search: selection._Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(selection, "may_be_likelier", lambda fit, incumbent, form, least, partitions: promising)
    search.fixed = fixed
    assert gone_on(search, misfit) == [ALIKE]
    assert search.tried == []


def test_a_search_asks_for_other_forms_of_what_has_entered(
    search: selection._Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    entered = trial(ALIKE, 100.0)
    trials = [entered, trial(UNEVEN, 95.0), trial(OFFSET, 98.0)]
    search.forms = []
    monkeypatch.setattr(selection, "screen", lambda *given: [])
    monkeypatch.setattr(selection, "form_error", lambda *given: SimpleNamespace(gain=0.0))
    monkeypatch.setattr(selection, "trials_of", lambda *given: [trials])
    monkeypatch.setattr(
        selection._Search, "_first_to_enter", lambda *given: (trials, trials, (entered, fit_of(ALIKE, misfit=1.6)))
    )
    monkeypatch.setattr(selection, "of_few_numbers", lambda build, incumbent, entered, *rest: entered)
    fit = search.one_more(fit_of())
    assert fit is not None
    assert [one.trial for one in search.forms] == [trials[1]]
    assert [(rival.effect, rival.short) for rival in search.forms[0].rivals] == [(OFFSET.effect, 2.0)]
    monkeypatch.setattr(selection._Search, "grown", lambda search, fit, *until: fit)
    monkeypatch.setattr(selection._Search, "fields_reconsidered", lambda search, chosen, fit: (chosen, fit))
    asked = []

    def with_other_forms(search: selection._Search, chosen: Any, fit: CheckedFit) -> tuple[Any, CheckedFit]:
        asked.extend(search.forms)
        return chosen, fit

    monkeypatch.setattr(selection._Search, "with_other_forms", with_other_forms)
    search.found(fit)
    assert [one.trial for one in asked] == [trials[1]]
