"""A specimen that shows nothing of what the skin remembers is another piece of fabric."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.full_solution_check import CheckedFit
from ertskin.diagnosis.search import selection
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis

LOOP = PiezoHysteresis(width=0.1)


def checked_fit(own: tuple[Any, ...] = ()) -> Any:
    """A fit of a skin and a specimen that remembers by its ``own`` effects."""
    problem: Any = SimpleNamespace(specimen=SimpleNamespace(effects=own), evidence=SimpleNamespace(criteria=DEFAULT))
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
    monkeypatch.setattr(selection, "_reconsidered", lambda build, proposed: proposed)
    left_out = not alike and not own
    assert made._where_readings_remember(incumbent) is (apart if left_out else incumbent)
    assert made.disagrees is left_out


def test_a_specimen_that_differs_in_the_end_has_no_say_in_what_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    # The specimen remembers, the skin doesn't: a field that made up for the specimen's law goes with it.
    incumbent, apart = checked_fit((LOOP,)), checked_fit()
    apart = replace(apart, problem=SimpleNamespace(specimen=None))  # type: ignore[arg-type]
    monkeypatch.setattr(selection, "remembers_alike", lambda specimen, effects, criteria: False)
    monkeypatch.setattr(selection, "where_it_settles", lambda build, problem, solved: apart)
    monkeypatch.setattr(selection, "_reconsidered", lambda build, proposed: proposed)
    calibrations = iter((incumbent, apart))
    monkeypatch.setattr(selection, "_calibrated", lambda build, fixed, start: next(calibrations))
    monkeypatch.setattr(selection._Search, "grown", lambda search, fit: fit)

    def pruned(search: selection._Search, fit: CheckedFit) -> tuple[tuple[Any, ...], CheckedFit]:
        return (() if fit.problem.specimen is None else ("a field",)), fit

    monkeypatch.setattr(selection._Search, "pruned", pruned)
    found = selection.select(None, (), (), None, [], lambda share, text: None)  # type: ignore[arg-type]
    assert found.specimen == "disagrees"
    assert found.chosen == ()
    assert found.before is apart.solved
