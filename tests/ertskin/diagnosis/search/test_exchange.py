"""Of two memories that explain nearly the same the right one takes the place of the one that entered first."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from small_problem import PARTITIONS, START, recorded

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.full_solution_check import CheckedFit, checked_fit
from ertskin.diagnosis.fit.nonreciprocal import acquires
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.exchange import HOPELESS, exchanged, gain_of_exchange, leaves_a_mismatch
from ertskin.diagnosis.search.trials import Trial
from ertskin.physics.effects.channel_gain import ChannelGain
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity

LOOP, CREEP = PiezoHysteresis(width=0.1), PiezoCreep(fraction=0.1, time_s=10.0)
GAIN, STRETCH = ChannelGain(channel=2, gain=3e-5), SheetAnisotropy(stretch_x=0.05)
HILL = SheetInhomogeneity(amplitude=0.1, x_m=0.03, y_m=0.03, radius_m=0.02)
FREE = {
    LOOP.name: ("width",),
    CREEP.name: ("fraction",),
    GAIN.name: ("gain",),
    STRETCH.name: ("stretch_x",),
    HILL.name: ("amplitude",),
}


def both_ways(hidden: Effect, first: Effect, second: Effect, fixed: int = 0) -> tuple[CheckedFit, list[Trial], int]:
    """The fit of readings with one effect by the first, and the trial of the second beside it."""
    problem = recorded(hidden)
    one, other = (Term(effect, FREE[effect.name]) for effect in (first, second))
    incumbent = checked_fit(problem, problem.solve([one], START))
    counted = acquires([first, second])
    solved = problem.solve([*incumbent.solved.terms, other], incumbent.solved.calibration, leftover=counted)
    return incumbent, [Trial(solved.terms[-1], 0.0, solved)], fixed


def swapped(incumbent: CheckedFit, trials: list[Trial], fixed: int) -> tuple[Term, CheckedFit, float] | None:
    return exchanged(lambda solved: incumbent.problem, incumbent, trials, fixed, PARTITIONS)


@pytest.mark.parametrize(("hidden", "wrong"), [(LOOP, CREEP), (CREEP, LOOP)])
def test_the_right_memory_takes_the_wrong_one_s_place(hidden: Effect, wrong: Effect) -> None:
    found = swapped(*both_ways(hidden, wrong, hidden))
    assert found is not None
    left, fit, gain = found
    assert left.name == wrong.name
    assert [effect.name for effect in fit.solved.effects] == [hidden.name]
    (key,) = FREE[hidden.name]
    assert fit.solved.effects[0].value(key) == pytest.approx(hidden.value(key), rel=0.05)
    assert gain > 100.0


@pytest.mark.parametrize(("hidden", "wrong"), [(LOOP, CREEP), (CREEP, LOOP)])
def test_the_wrong_memory_doesn_t_take_the_right_one_s_place(hidden: Effect, wrong: Effect) -> None:
    assert swapped(*both_ways(hidden, hidden, wrong)) is None


def test_what_a_fit_loses_without_a_term_is_predicted() -> None:
    incumbent, (trial,), _ = both_ways(LOOP, LOOP, CREEP)
    for k, term in enumerate(trial.solved.terms):
        rest = [one for one in trial.solved.terms if one is not term]
        lost = incumbent.problem.solve(rest, trial.solved.calibration).cost - trial.solved.cost
        assert trial.solved.rise_without(k) == pytest.approx(lost, rel=0.5, abs=1.0)


def test_a_swap_without_hope_is_not_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    incumbent, trials, fixed = both_ways(LOOP, LOOP, CREEP)
    assert trials[0].solved.rise_without(0) > HOPELESS * incumbent.solved.cost
    monkeypatch.setattr(type(incumbent.problem), "solve", None)
    assert swapped(incumbent, trials, fixed) is None


def test_what_belongs_to_every_set_and_what_is_no_kin_stay() -> None:
    assert swapped(*both_ways(LOOP, CREEP, LOOP, fixed=1)) is None
    assert swapped(*both_ways(STRETCH, CREEP, STRETCH)) is None


def test_a_sheet_doesn_t_take_a_channel_s_place_by_what_it_needn_t_explain() -> None:
    incumbent, trials, fixed = both_ways(GAIN, GAIN, replace(STRETCH, stretch_x=1e-4))
    assert incumbent.solved.leftover
    assert swapped(incumbent, trials, fixed) is None


def test_a_channel_takes_the_place_of_a_sheet() -> None:
    found = swapped(*both_ways(replace(GAIN, gain=3e-3), replace(STRETCH, stretch_x=1e-3), replace(GAIN, gain=3e-3)))
    assert found is not None
    assert [effect.name for effect in found[1].solved.effects] == [GAIN.name]


def test_a_field_takes_nobody_s_place() -> None:
    hill = replace(HILL, amplitude=2e-3)
    incumbent, trials, fixed = both_ways(hill, replace(STRETCH, stretch_x=1e-4), hill)
    assert trials[0].solved.cost < 0.5 * incumbent.solved.cost
    assert swapped(incumbent, trials, fixed) is None


def test_what_no_network_explains_counts_for_both_or_for_neither() -> None:
    problem = recorded(GAIN)
    with_it = checked_fit(problem, problem.solve([Term(GAIN, ("gain",))], START, leftover=True))
    without = checked_fit(problem, problem.solve([], START))
    assert (with_it.solved.leftover, without.solved.leftover) == (True, False)
    gain = gain_of_exchange(without, with_it)
    assert gain > 100.0
    assert gain_of_exchange(with_it, without) == pytest.approx(-gain, rel=1e-6)


@pytest.mark.parametrize(
    ("misfit", "beyond", "specimen", "leaves"),
    [(1.2, 1.0, 1.0, True), (1.02, 1.0, 1.0, False), (1.02, 4.0, 1.0, True), (1.02, 1.0, 4.0, True)],
    ids=["scans", "nothing", "what no network explains", "the specimen"],
)
def test_a_swap_is_looked_for_where_a_mismatch_stays(
    misfit: float, beyond: float, specimen: float, leaves: bool
) -> None:
    problem: Any = SimpleNamespace(
        evidence=SimpleNamespace(criteria=DEFAULT),
        family=SimpleNamespace(skin=lambda calibration, effects: None),
        # Readings that weren't taken are noughts.
        acquisition=SimpleNamespace(residual=lambda skin: np.array([[beyond, -beyond, 0.0, 0.0]])),
        specimen=SimpleNamespace(residual=lambda skin: np.full(3, specimen)),
    )
    solved: Any = SimpleNamespace(calibration=None, effects=())
    assert leaves_a_mismatch(CheckedFit(problem, solved, misfit, 0.0)) is leaves
