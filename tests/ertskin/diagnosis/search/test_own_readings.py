"""A specimen that shows nothing of what the skin remembers is another piece of fabric."""

from __future__ import annotations

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
    solved: Any = SimpleNamespace(effects=())
    return CheckedFit(problem, solved, 1.0, 0.0)


@pytest.mark.parametrize(("alike", "own"), [(True, ()), (False, (LOOP,)), (False, ())])
def test_a_specimen_that_shows_nothing_of_what_the_skin_remembers_is_left_out(
    alike: bool, own: tuple[Any, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    incumbent, apart = checked_fit(own), checked_fit()
    made = selection._Search(None, [], lambda share, text: None, 0, {})  # type: ignore[arg-type]
    monkeypatch.setattr(selection, "remembers_alike", lambda specimen, effects, criteria: alike)
    monkeypatch.setattr(selection, "_where_it_settles", lambda build, problem, solved: apart)
    monkeypatch.setattr(selection, "_reconsidered", lambda build, proposed: proposed)
    left_out = not alike and not own
    assert made._by_own_readings(incumbent) is (apart if left_out else incumbent)
    assert made.disagrees is left_out
