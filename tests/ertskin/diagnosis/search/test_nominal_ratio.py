"""Where the ratio of moduli makes up for what is missing, that is looked for with the ratio held, and it is let go."""

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
from ertskin.diagnosis.search import nominal_ratio, selection
from ertskin.diagnosis.search.nominal_ratio import HELD, at_nominal, has_run_away, held_at_nominal, let_go
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity

FAR = -WIDEST_RATIO


def test_a_ratio_goes_no_further_than_it_is_held() -> None:
    # Half as sensitive on one side of the small sheet: its four presses would have a foam that is none.
    problem = recorded(PiezoInhomogeneity(amplitude=0.3, x_m=0.03, y_m=0.03, radius_m=0.02))
    free = problem.solve([], START)
    held = held_at_nominal(lambda solved: problem)(free).solve([], at_nominal(free).calibration)
    assert at_nominal(free).calibration.log_ratio == 0.0
    assert abs(free.calibration.log_ratio) > 2 * HELD
    assert abs(held.calibration.log_ratio) <= HELD
    assert held.cost > free.cost


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


def fit_of(*terms: str, ratio: float, held: bool = False, misfit: float = 1.6) -> CheckedFit:
    problem: Any = Problem(widest_ratio=HELD if held else WIDEST_RATIO)
    solved: Any = Solved(terms, replace(START, log_ratio=ratio))
    return CheckedFit(problem, solved, misfit, 0.0)


def build(solved: Any) -> Any:
    """A problem linearised about any fit."""
    return Problem()


@pytest.mark.parametrize(("ratio", "far"), [(0.0, False), (0.99, False), (-1.0, True), (2.5, True)])
def test_a_ratio_has_run_away_from_a_part_of_the_widest_on(ratio: float, far: bool) -> None:
    assert has_run_away(fit_of(ratio=ratio).solved) is far


@pytest.mark.parametrize(
    ("free", "missed", "goes"),
    [
        (fit_of("field", ratio=0.3), (1.0, 9.0), True),
        (fit_of("field", ratio=FAR), (9.0, 1.0), True),
        (fit_of("field", ratio=FAR), (1.0, 9.0), False),
        (fit_of("field", ratio=0.3, misfit=1.7), (9.0, 1.0), False),
        (None, (9.0, 1.0), False),
    ],
    ids=["it stays near", "far and predicts better", "far and predicts worse", "fits worse", "settles nowhere"],
)
def test_the_ratio_is_let_go_unless_it_runs_away_for_nothing(
    free: CheckedFit | None, missed: tuple[float, float], goes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    held, holding = fit_of("field", ratio=0.0, held=True), held_at_nominal(build)
    monkeypatch.setattr(nominal_ratio, "where_it_settles", lambda build, problem, solved: free)
    by_ratio = {0.0: missed[0]}
    monkeypatch.setattr(
        nominal_ratio,
        "log_misfit_held_out",
        lambda problem, solved, partitions: by_ratio.get(solved.calibration.log_ratio, missed[1]),
    )
    builds, found = let_go(holding, held, [])
    assert found is (free if goes else held)
    assert builds(None).widest_ratio == (WIDEST_RATIO if goes else HELD)


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> selection._Search:
    """One to which a field enters where the ratio is held."""

    def settles(build: Any, problem: Any, solved: Any) -> CheckedFit:
        held = build(solved).widest_ratio == HELD
        return fit_of(*solved.terms, ratio=0.0 if held else 0.2, held=held, misfit=1.9 if held else 1.0)

    def one_more(search: selection._Search, fit: CheckedFit) -> CheckedFit:
        assert search.build(None).widest_ratio == HELD
        assert not has_run_away(fit.solved)
        search.forms.append("another form")  # type: ignore[arg-type]
        return fit_of(*fit.solved.terms, "field", ratio=0.0, held=True, misfit=1.0)

    for module in (selection, nominal_ratio):
        monkeypatch.setattr(module, "where_it_settles", settles)
    monkeypatch.setattr(selection._Search, "_entered", one_more)
    return selection._Search(build, [], lambda share, text: None, 0, {})


def test_what_is_missing_is_looked_for_at_nominal_where_the_ratio_has_run_away(search: selection._Search) -> None:
    found = search.begun_at_nominal(fit_of("loop", ratio=FAR))
    assert (found.solved.terms, found.solved.calibration.log_ratio) == (("loop", "field"), 0.2)
    assert search.build(None).widest_ratio == WIDEST_RATIO
    assert search.forms == ["another form"]


@pytest.mark.parametrize(
    ("incumbent", "grows"),
    [(fit_of(ratio=0.5), True), (fit_of(ratio=FAR, misfit=1.0), True), (fit_of(ratio=FAR), False)],
    ids=["near nominal", "nothing is missing", "nothing enters"],
)
def test_else_the_search_is_left_as_it_is(
    incumbent: CheckedFit, grows: bool, search: selection._Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not grows:
        monkeypatch.setattr(selection._Search, "_entered", lambda search, fit: None)
    assert search.begun_at_nominal(incumbent) is incumbent
    assert search.build is build
    assert search.forms == []
