"""A specimen without the skin's memory is another fabric; contacts that seem to wander may be what places keep."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ertskin.diagnosis.contract.claims import Tried
from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.full_solution_check import CheckedFit
from ertskin.diagnosis.recording.work import Work
from ertskin.diagnosis.search import selection
from ertskin.physics.effects.hypothesis import Measured
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis

LOOP = PiezoHysteresis(width=0.1)


def checked_fit(own: tuple[Any, ...] = ()) -> Any:
    """A fit of a skin and a specimen that remembers by its ``own`` effects."""
    problem: Any = SimpleNamespace(
        specimen=SimpleNamespace(effects=own), evidence=SimpleNamespace(criteria=DEFAULT, work=Work())
    )
    solved: Any = SimpleNamespace(effects=(), terms=())
    return CheckedFit(problem, solved, 1.0, 0.0)


@pytest.mark.parametrize(("alike", "own"), [(True, ()), (False, (LOOP,)), (False, ())])
def test_a_specimen_that_shows_nothing_of_what_the_skin_remembers_is_left_out(
    alike: bool, own: tuple[Any, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    incumbent, apart = checked_fit(own), checked_fit()
    made = selection._Search(None, [], lambda share, text: None, 0, {})  # type: ignore[arg-type]
    monkeypatch.setattr(selection, "remembers_alike", lambda specimen, effects, criteria: alike)
    monkeypatch.setattr(selection, "where_it_settles", lambda build, problem, solved: apart)
    monkeypatch.setattr(selection, "reconsidered", lambda build, proposed: proposed)
    left_out = not alike and not own
    assert made._where_readings_remember(incumbent) is (apart if left_out else incumbent)
    assert made.disagrees is left_out


def test_a_specimen_that_differs_in_the_end_has_no_say_in_what_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    # The specimen remembers, the skin doesn't: a field that made up for the specimen's law goes with it.
    incumbent, apart = checked_fit((LOOP,)), checked_fit()
    without: Any = SimpleNamespace(specimen=None, evidence=SimpleNamespace(criteria=DEFAULT, work=Work()))
    apart = replace(apart, problem=without)
    monkeypatch.setattr(selection, "remembers_alike", lambda specimen, effects, criteria: False)
    monkeypatch.setattr(selection, "where_it_settles", lambda build, problem, solved: apart)
    monkeypatch.setattr(selection, "reconsidered", lambda build, proposed: proposed)
    calibrations = iter((incumbent, apart))
    monkeypatch.setattr(selection, "_calibrated", lambda build, fixed, start: next(calibrations))
    monkeypatch.setattr(selection._Search, "begun_at_nominal", lambda search, fit: fit)
    monkeypatch.setattr(selection._Search, "grown", lambda search, fit: fit)

    def pruned(search: selection._Search, fit: CheckedFit) -> tuple[tuple[Any, ...], CheckedFit]:
        return (() if fit.problem.specimen is None else ("a field",)), fit

    monkeypatch.setattr(selection._Search, "pruned", pruned)
    found = selection.select(None, (), (), None, [], lambda share, text: None)  # type: ignore[arg-type]
    assert found.specimen == "disagrees"
    assert found.chosen == ()
    assert found.before is apart.solved


def named(measured: Measured | None, remembers_air: bool) -> Any:
    """A term as far as the search asks for it."""
    hypothesis = SimpleNamespace(measured=measured)
    effect = SimpleNamespace(hypothesis=hypothesis, remembers_air=remembers_air)
    return SimpleNamespace(name="it", effect=effect, modes=None, by_place=False)


WANDERS, CREEP, LOOP_ALONE = named(Measured.CONTACT_PATH, False), named(None, True), named(None, False)


def fit_of(terms: tuple[Any, ...], at_rest: float) -> CheckedFit:
    """A fit with these terms whose frames at rest are off by so much, one up, the next down."""
    evidence = SimpleNamespace(criteria=DEFAULT, rest=np.ones(4, bool))
    problem: Any = SimpleNamespace(
        specimen=None,
        evidence=evidence,
        weight=np.ones(4),
        solve=lambda terms, calibration, leftover: fit_of(tuple(terms), at_rest).solved,
    )
    solved: Any = SimpleNamespace(
        effects=tuple(term.effect for term in terms),
        terms=terms,
        calibration=None,
        leftover=False,
        scan_residual=at_rest * np.array([[1.0], [-1.0], [1.0], [-1.0]]) * np.ones(3),
    )
    return CheckedFit(problem, solved, 1.0, 0.0)


@pytest.mark.parametrize(
    ("contacts", "entered", "alone", "both", "taken"),
    [
        (2, CREEP, 1.0, 1.0, True),
        (2, CREEP, 2.0, 1.0, False),
        (2, LOOP_ALONE, 1.0, 1.0, False),
        (2, None, 1.0, 1.0, False),
        (0, CREEP, 1.0, 1.0, False),
    ],
    ids=["explains rest alone", "both are needed", "nothing stays", "nothing enters", "no contact wanders"],
)
def test_what_places_keep_takes_the_stead_of_contacts_that_wander(
    contacts: int, entered: Any, alone: float, both: float, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def one_more(search: selection._Search, without: CheckedFit, wanted: Callable[[Any], bool]) -> CheckedFit | None:
        assert not without.solved.terms
        forgets, may = (SimpleNamespace(solved=SimpleNamespace(effects=(one,))) for one in (object(), PiezoCreep()))
        assert (wanted(forgets), wanted(may)) == (False, True)
        search.tried.append(Tried(("it",), 9.0, True))
        return None if entered is None else fit_of((entered,), alone)

    def where_it_settles(build: object, problem: object, solved: Any) -> CheckedFit:
        assert [term is WANDERS for term in solved.terms] == [True] * contacts + [False]
        return fit_of(tuple(solved.terms), both)

    monkeypatch.setattr(selection._Search, "one_more", one_more)
    monkeypatch.setattr(selection, "where_it_settles", where_it_settles)
    monkeypatch.setattr(selection, "in_fabric", lambda effects: effects)
    monkeypatch.setattr(selection, "_calibrated", lambda build, fixed, start: fit_of(tuple(fixed), 3.0))
    search = selection._Search(None, [], lambda share, text: None, contacts, {})  # type: ignore[arg-type]
    monkeypatch.setattr(selection._Search, "found", lambda search, fit: ((), fit))
    _, found = search.found_remembering(fit_of((WANDERS,) * contacts, 2.0), None)  # type: ignore[arg-type]
    assert (WANDERS not in found.solved.terms) == (taken or not contacts)
    assert search.fixed == (0 if taken else contacts)
    assert [one.kept for one in search.tried] == ([taken] if contacts else [])


def test_what_entered_before_a_memory_is_asked_of_contacts_may_still_go(monkeypatch: pytest.MonkeyPatch) -> None:
    field = named(None, False)
    monkeypatch.setattr(selection._Search, "one_more", lambda search, fit, wanted: fit_of((field, CREEP), 1.0))
    monkeypatch.setattr(selection, "_as_good_alone", lambda build, fit, contacts: True)
    monkeypatch.setattr(selection, "in_fabric", lambda effects: effects)
    monkeypatch.setattr(selection, "_calibrated", lambda build, fixed, start: fit_of(tuple(fixed), 3.0))
    monkeypatch.setattr(selection._Search, "found", lambda search, fit: ((), fit))
    search = selection._Search(None, [], lambda share, text: None, 1, {})  # type: ignore[arg-type]
    _, found = search.found_remembering(fit_of((WANDERS, field), 2.0), None)  # type: ignore[arg-type]
    assert found.solved.terms == (field, CREEP)
    assert search.fixed == 0


@pytest.mark.parametrize("kept", [True, False])
def test_where_no_memory_is_left_the_contacts_are_asked(kept: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    contacts, memory = fit_of((WANDERS,), 1.0), fit_of((CREEP,), 1.0)
    asked: list[int] = []

    def grown(search: selection._Search, fit: CheckedFit) -> CheckedFit:
        asked.append(search.fixed)
        return fit if kept or fit is contacts else fit_of((), 1.0)

    def remembering(search: selection._Search, incumbent: CheckedFit, start: object) -> CheckedFit:
        search.fixed = 0
        return memory

    monkeypatch.setattr(selection, "in_fabric", lambda effects: effects)
    monkeypatch.setattr(selection, "_calibrated", lambda build, fixed, start: contacts)
    monkeypatch.setattr(selection._Search, "begun_at_nominal", lambda search, fit: fit)
    monkeypatch.setattr(selection._Search, "_remembering", remembering)
    monkeypatch.setattr(selection._Search, "grown", grown)
    monkeypatch.setattr(selection._Search, "pruned", lambda search, fit: ((), fit))
    found = selection.select(None, (WANDERS,), (), None, [], lambda share, text: None)  # type: ignore[arg-type]
    assert asked == ([0] if kept else [0, 1])
    assert found.after is (memory if kept else contacts).solved
