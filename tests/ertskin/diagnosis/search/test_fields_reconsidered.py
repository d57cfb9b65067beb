"""A field that entered while other effects were missing is asked for once more where they are there, and what it hides
before it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from ertskin.diagnosis.contract.claims import Tried
from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.full_solution_check import CheckedFit
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.recording.work import Work
from ertskin.diagnosis.search import entering, selection
from ertskin.diagnosis.search.candidates import Candidate
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.self_heating import SelfHeating
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity
from ertskin.physics.effects.temperature_drift import TemperatureDrift


@pytest.fixture(autouse=True)
def nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unless a test says otherwise fields stand in for nothing."""
    monkeypatch.setattr(selection, "behind_field", lambda problem, solved, number: [])


UNEVEN = SheetInhomogeneity(amplitude=0.1)


@dataclass(frozen=True)
class NamedTerm:
    """A term as far as the search asks for it."""

    name: str
    modes: object | None = None
    by_place: bool = False
    effect: Effect = UNEVEN


FIELD, DRIFT, PAD, LOOP = NamedTerm("field", "modes"), NamedTerm("drift"), NamedTerm("pad"), NamedTerm("loop")


def fit_of(*terms: NamedTerm, misfit: float = 1.0) -> CheckedFit:
    solved: Any = SimpleNamespace(terms=terms, calibration=None, leftover=False)
    problem: Any = SimpleNamespace(
        evidence=SimpleNamespace(criteria=DEFAULT, work=Work()),
        solve=lambda terms, calibration, leftover: fit_of(*terms).solved,
    )
    return CheckedFit(problem, solved, misfit, 0.0)


def reconsidered(
    incumbent: CheckedFit, then: NamedTerm | None, monkeypatch: pytest.MonkeyPatch, misfit: float = 1.0, fixed: int = 0
) -> tuple[list[str], list[str]]:
    """The names chosen where ``then`` enters in the field's place, and those it was asked beside."""
    asked: list[str] = []

    def one_more(search: selection._Search, without: CheckedFit, wanted: Callable[[Any], bool]) -> CheckedFit | None:
        asked.extend(term.name for term in without.solved.terms)
        assert [wanted(SimpleNamespace(term=term)) for term in (FIELD, PAD)] == [False, True]
        return None if then is None else replace(fit_of(*without.solved.terms, then), misfit=misfit)

    monkeypatch.setattr(selection, "where_it_settles", lambda build, problem, solved: fit_of(*solved.terms))
    monkeypatch.setattr(selection._Search, "one_more", one_more)
    monkeypatch.setattr(selection._Search, "grown", lambda search, fit, *until: fit)
    monkeypatch.setattr(selection._Search, "pruned", lambda search, fit: (tuple(fit.solved.terms[fixed:]), fit))
    search = selection._Search(None, [], lambda share, text: None, fixed, {})  # type: ignore[arg-type]
    chosen: Any = tuple(incumbent.solved.terms[fixed:])
    found, fit = search.fields_reconsidered(chosen, incumbent)
    assert tuple(fit.solved.terms[fixed:]) == found
    return [term.name for term in fit.solved.terms[fixed:]], asked


def test_what_explains_as_much_beside_the_others_takes_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    assert reconsidered(fit_of(FIELD, DRIFT), PAD, monkeypatch) == (["drift", "pad"], ["drift"])


@pytest.mark.parametrize("then", [FIELD, None])
def test_the_field_stays_where_it_is_the_likeliest_again(
    then: NamedTerm | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert reconsidered(fit_of(FIELD, DRIFT), then, monkeypatch) == (["field", "drift"], ["drift"])


def test_what_fits_worse_in_the_end_takes_nobodys_place(monkeypatch: pytest.MonkeyPatch) -> None:
    assert reconsidered(fit_of(FIELD, DRIFT), PAD, monkeypatch, misfit=1.2)[0] == ["field", "drift"]


@pytest.mark.parametrize("terms", [(DRIFT, FIELD), (LOOP, DRIFT)])
def test_the_last_to_enter_and_what_is_no_field_are_not_asked(
    terms: tuple[NamedTerm, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert reconsidered(fit_of(*terms), PAD, monkeypatch) == ([term.name for term in terms], [])


def test_fixed_terms_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    assert reconsidered(fit_of(FIELD, DRIFT, LOOP), PAD, monkeypatch, fixed=1) == (["drift", "loop"], [])


@pytest.mark.parametrize("misfit", [1.0, 1.2])
def test_a_search_that_comes_to_nothing_changes_nothing(misfit: float, monkeypatch: pytest.MonkeyPatch) -> None:
    def one_more(search: selection._Search, without: CheckedFit, wanted: object) -> CheckedFit:
        search.tried.append(Tried(("drift", "pad"), 9.0, True))
        search.stand["pad:"] = ()
        return replace(fit_of(*without.solved.terms, PAD), misfit=misfit)

    def grown(search: selection._Search, fit: CheckedFit, *until: object) -> CheckedFit:
        search.disagrees, search.build, search.fixed = True, fit_of, 0
        return fit

    monkeypatch.setattr(selection, "where_it_settles", lambda build, problem, solved: fit_of(*solved.terms))
    monkeypatch.setattr(selection._Search, "one_more", one_more)
    monkeypatch.setattr(selection._Search, "grown", grown)
    monkeypatch.setattr(selection._Search, "pruned", lambda search, fit: ((), fit))
    search = selection._Search(None, [], lambda share, text: None, 1, {})  # type: ignore[arg-type]
    search.fields_reconsidered((), fit_of(LOOP, FIELD, DRIFT))
    taken = misfit == 1.0
    assert (search.disagrees, search.build, search.fixed) == ((True, fit_of, 0) if taken else (False, None, 1))
    assert ("pad:" in search.stand) == taken
    assert [one.kept for one in search.tried] == [taken]


WARM = Term(SelfHeating(crowded_rise=-0.01), ("crowded_rise",))
DRIFTING = Term(TemperatureDrift(rate_per_h=0.1), ("rate_per_h",))


def with_what_is_hidden(
    incumbent: CheckedFit,
    monkeypatch: pytest.MonkeyPatch,
    then: tuple[NamedTerm, ...] = (FIELD,),
    misfit: float = 1.0,
    gain: float = 900.0,
    specimen_goes: bool = False,
    behind: tuple[Candidate, ...] = (Candidate(WARM, 68.0),),
    fixed: int = 0,
    promises: bool = True,
) -> tuple[list[str], selection._Search]:
    """The names chosen where warmth is found ``behind`` a field, and ``then`` follow it; and the search."""

    def grown(search: selection._Search, fit: CheckedFit, *until: object) -> CheckedFit:
        search.disagrees = search.disagrees or specimen_goes
        return replace(fit_of(*fit.solved.terms, *then), misfit=misfit)

    monkeypatch.setattr(selection, "behind_field", lambda problem, solved, number: list(behind))
    monkeypatch.setattr(selection, "where_it_settles", lambda build, problem, solved: fit_of(*solved.terms))
    monkeypatch.setattr(selection, "refined", lambda build, fit, partitions, free: fit)
    monkeypatch.setattr(selection, "gain_of_exchange", lambda present, proposed: gain)
    monkeypatch.setattr(selection, "promises", lambda incumbent, proposed, field, partitions: promises)
    monkeypatch.setattr(selection._Search, "one_more", lambda search, without, wanted: None)
    monkeypatch.setattr(selection._Search, "_where_readings_remember", lambda search, fit: fit)
    monkeypatch.setattr(selection._Search, "_without_drifts", lambda search, fit: fit)
    monkeypatch.setattr(selection._Search, "grown", grown)
    monkeypatch.setattr(selection._Search, "pruned", lambda search, fit: (chosen_of(fit), fit))
    search = selection._Search(None, [], lambda share, text: None, fixed, {})  # type: ignore[arg-type]
    found, fit = search.fields_reconsidered(chosen_of(incumbent), incumbent)
    assert found == chosen_of(fit)
    return [term.name for term in fit.solved.terms], search


def chosen_of(fit: CheckedFit) -> Any:
    return tuple(SimpleNamespace(term=term) for term in fit.solved.terms)


@pytest.mark.parametrize("then", [(FIELD,), ()], ids=["and the field", "alone"])
def test_what_a_field_hides_enters_before_it(then: tuple[NamedTerm, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    found, search = with_what_is_hidden(fit_of(FIELD), monkeypatch, then=then)
    assert found == ["self_heating", *(term.name for term in then)]
    assert search.tried[-1] == Tried(tuple(found), 900.0, True)


@pytest.mark.parametrize(
    "found",
    [
        {"misfit": 1.2},
        {"gain": 1.0},
        {"specimen_goes": True},
        {"promises": False},
    ],
    ids=["worse", "no likelier", "without the specimen", "promises nothing"],
)
def test_a_field_that_hides_nothing_stays(found: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    names, search = with_what_is_hidden(fit_of(FIELD), monkeypatch, **found)
    assert names == ["field"]
    assert not any(one.kept for one in search.tried)
    assert search.stand == {}
    assert not search.disagrees


def test_the_likeliest_enters_and_the_others_and_the_field_are_its_rivals(monkeypatch: pytest.MonkeyPatch) -> None:
    behind = (Candidate(WARM, 68.0), Candidate(DRIFTING, 66.0), Candidate(DRIFTING, 3.0))
    names, search = with_what_is_hidden(fit_of(FIELD), monkeypatch, behind=behind)
    assert names == ["self_heating", "field"]
    rivals = [(one.effect.name, one.short) for one in search.stand["self_heating:"]]
    assert rivals == [("temperature_drift", 2.0), ("sheet_inhomogeneity", 68.0)]


@pytest.mark.parametrize(
    ("gain", "entering", "expected"),
    [
        pytest.param(5.0, [FIELD, LOOP], ["pad", "field"], id="all names are back, and nothing is gained"),
        pytest.param(5.0, [LOOP, FIELD], ["pad", "loop", "field"], id="not before they are"),
        pytest.param(900.0, [FIELD, LOOP], ["pad", "field", "loop"], id="what is likelier is gone on with"),
    ],
)
def test_what_follows_is_given_up_where_the_incumbent_says_as_much(
    gain: float, entering: list[NamedTerm], expected: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = list(entering)

    def entered(search: selection._Search, fit: CheckedFit) -> CheckedFit | None:
        present: Any = fit.solved.terms
        return fit_of(*present, asked.pop(0)) if asked else None

    monkeypatch.setattr(selection, "gain_of_exchange", lambda present, proposed: gain)
    monkeypatch.setattr(selection, "rms_of", lambda solved: 1.2)
    monkeypatch.setattr(selection._Search, "_entered", entered)
    monkeypatch.setattr(selection._Search, "pruned", lambda search, fit: (chosen_of(fit), fit))
    search = selection._Search(None, [], lambda share, text: None, 0, {})  # type: ignore[arg-type]
    found = search._followed(search._apart(), fit_of(PAD), fit_of(FIELD), 11.0)
    assert (found is not None) == (gain > 11.0)
    assert search.tried[-1].effects == tuple(expected)


@pytest.mark.parametrize("behind", [(), (Candidate(WARM, 9.0),)])
def test_what_gains_by_chance_is_not_hidden(behind: tuple[Candidate, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    names, search = with_what_is_hidden(fit_of(FIELD), monkeypatch, behind=behind)
    assert names == ["field"]
    assert search.tried == []


def test_a_fixed_term_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    names, _ = with_what_is_hidden(fit_of(FIELD, LOOP), monkeypatch, fixed=1)
    assert names == ["field", "loop"]


@pytest.mark.parametrize(
    "incumbent", [fit_of(DRIFT), fit_of(replace(FIELD, by_place=True))], ids=["no field", "told by place"]
)
def test_without_a_smooth_field_nothing_is_hidden(incumbent: CheckedFit, monkeypatch: pytest.MonkeyPatch) -> None:
    names, search = with_what_is_hidden(incumbent, monkeypatch)
    assert names == [term.name for term in incumbent.solved.terms]
    assert search.tried == []


@pytest.mark.parametrize(
    ("alone", "with_field", "promises"), [(900.0, None, True), (-9e4, 1.0, True), (-9e4, -1.0, False)]
)
def test_a_fit_promises_what_it_gains_alone_or_beside_the_field(
    alone: float, with_field: float | None, promises: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    incumbent, proposed = fit_of(FIELD), fit_of(PAD)
    both = None if with_field is None else fit_of(PAD, FIELD).solved
    solved: Any = proposed.problem
    solved.solve = lambda terms, calibration, steps: fit_of(*terms).solved
    monkeypatch.setattr(entering, "with_smooth_field", lambda problem, begun, number, partitions: both)
    monkeypatch.setattr(
        entering, "gain_of_exchange", lambda present, fit: alone if fit is proposed else cast(float, with_field)
    )
    assert entering.promises(incumbent, proposed, Term(UNEVEN, ("amplitude",)), []) is promises
