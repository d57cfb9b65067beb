"""Where the ratio of moduli makes up for what is missing, that is looked for near nominal, and the ratio let go."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import pytest
from small_problem import START, recorded

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.full_solution_check import CheckedFit
from ertskin.diagnosis.linear.calibration_vector import WIDEST_RATIO, Calibration
from ertskin.diagnosis.recording.work import Work
from ertskin.diagnosis.search import selection
from ertskin.diagnosis.search.nominal_ratio import NEAR, at_nominal, has_run_away, let_go, near_nominal
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity

FAR = -WIDEST_RATIO


def test_a_ratio_goes_no_further_than_near_nominal() -> None:
    # More sensitive on one side of the small sheet: its four presses would have a foam that is none.
    problem = recorded(PiezoInhomogeneity(amplitude=0.3, x_m=0.03, y_m=0.03, radius_m=0.02))
    free = problem.solve([], START)
    near = near_nominal(lambda solved: problem)
    kept = near(free).solve([], at_nominal(free).calibration)
    assert at_nominal(free).calibration.log_ratio == 0.0
    assert abs(free.calibration.log_ratio) > 2 * NEAR
    assert abs(kept.calibration.log_ratio) <= NEAR
    assert kept.cost > free.cost
    again = let_go(near)(kept).solve([], free.calibration)
    assert again.calibration.log_ratio == pytest.approx(free.calibration.log_ratio, abs=0.05)


@dataclass(frozen=True)
class Problem:
    """A fit's problem, as far as the ratio goes."""

    evidence: Any = field(default_factory=lambda: SimpleNamespace(criteria=DEFAULT, work=Work()))
    specimen: None = None
    widest_ratio: float = WIDEST_RATIO


@dataclass(frozen=True)
class Solved:
    """A fit of terms, as far as the ratio goes."""

    terms: tuple[str, ...]
    calibration: Calibration


def fit_of(*terms: str, ratio: float, misfit: float = 1.6) -> CheckedFit:
    problem: Any = Problem()
    solved: Any = Solved(terms, replace(START, log_ratio=ratio))
    return CheckedFit(problem, solved, misfit, 0.0)


def build(solved: Any) -> Any:
    """A problem linearised about any fit."""
    return Problem()


@pytest.mark.parametrize(("ratio", "far"), [(0.0, False), (0.99, False), (-1.0, True), (2.5, True)])
def test_a_ratio_has_run_away_from_a_part_of_the_widest_on(ratio: float, far: bool) -> None:
    assert has_run_away(fit_of(ratio=ratio).solved) is far


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> selection._Search:
    """One to which a field enters where the ratio is kept near nominal."""

    def settles(build: Any, problem: Any, solved: Any) -> CheckedFit:
        kept = build(solved).widest_ratio == NEAR
        return fit_of(*solved.terms, ratio=0.0 if kept else 0.2, misfit=1.9 if kept else 1.0)

    def enters(search: selection._Search, fit: CheckedFit) -> CheckedFit:
        assert search.build(None).widest_ratio == NEAR
        assert not has_run_away(fit.solved)
        search.forms.append("another form")  # type: ignore[arg-type]
        return fit_of(*fit.solved.terms, "field", ratio=0.0, misfit=1.0)

    monkeypatch.setattr(selection, "where_it_settles", settles)
    monkeypatch.setattr(selection, "reconsidered", lambda build, fit: fit)
    monkeypatch.setattr(selection._Search, "_entered", enters)
    return selection._Search(build, [], lambda share, text: None, 0, {})


def test_what_is_missing_is_looked_for_near_nominal_where_the_ratio_has_run_away(search: selection._Search) -> None:
    found = search.begun_at_nominal(fit_of("loop", ratio=FAR))
    assert (found.solved.terms, found.solved.calibration.log_ratio) == (("loop", "field"), 0.2)
    assert search.build(None).widest_ratio == WIDEST_RATIO
    assert search.forms == ["another form"]


@pytest.mark.parametrize(
    ("incumbent", "enters"),
    [
        (fit_of(ratio=0.5), True),
        (fit_of(ratio=FAR, misfit=1.0), True),
        (fit_of(*"abcde", ratio=FAR), True),
        (fit_of(ratio=FAR), False),
        (fit_of(ratio=FAR, misfit=1.04), None),
    ],
    ids=["near nominal", "nothing is missing", "as many as there may be", "none enters", "it fits worse with it"],
)
def test_else_the_search_is_left_as_it_is(
    incumbent: CheckedFit, enters: bool | None, search: selection._Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    if enters is False:
        monkeypatch.setattr(selection._Search, "_entered", lambda search, fit: None)
    if enters is None:
        monkeypatch.setattr(CheckedFit, "spoils", lambda fit, other: True)
    assert search.begun_at_nominal(incumbent) is incumbent
    assert search.build is build
    assert search.forms == []


def test_a_ratio_that_comes_back_by_itself_is_looked_at_first(
    search: selection._Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    back = fit_of("loop", ratio=0.1)
    monkeypatch.setattr(selection, "reconsidered", lambda build, fit: back)
    assert search.begun_at_nominal(fit_of("loop", ratio=FAR)) is back


def test_a_search_begins_near_nominal(search: selection._Search, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(selection, "_calibrated", lambda build, fixed, start: fit_of(ratio=FAR))
    monkeypatch.setattr(selection._Search, "found_remembering", lambda search, fit, start: ((), fit))
    monkeypatch.setattr(selection._Search, "specimen_differs", lambda search, fit: False)
    monkeypatch.setattr(selection._Search, "completed", lambda search, before, chosen, fit, specimen: fit)
    found: Any = selection.select(build, (), (), None, [], lambda share, text: None)  # type: ignore[arg-type]
    assert found.solved.terms == ("field",)
