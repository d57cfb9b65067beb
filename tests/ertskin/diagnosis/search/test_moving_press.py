"""A press that moves during its scan is expected to gain what its fit does: by the scans and beyond any network."""

from __future__ import annotations

import pytest
from small_problem import PARTITIONS, START, recorded

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.search.candidates import Candidate, screen
from ertskin.physics.effects.scan_skew import ScanSkew


def moving(problem: VoltageProblem, solved: Solved) -> list[Candidate]:
    return [candidate for candidate in screen(problem, solved, PARTITIONS) if candidate.name == ScanSkew.name]


@pytest.mark.parametrize("at_s", [0.0, 0.2, 0.4])
def test_a_moving_press_is_expected_to_gain_what_its_fit_gains(at_s: float) -> None:
    problem = recorded(ScanSkew(3e-4, at_s))
    expected = moving(problem, problem.solve([], START))[0]
    assert expected.term.effect.value("speed_m_per_s") == pytest.approx(3e-4, rel=0.5)
    without = problem.solve([], START, leftover=True)
    fit = problem.solve([expected.term], START, leftover=True)
    assert fit.effects[0].value("speed_m_per_s") == pytest.approx(3e-4, rel=0.05)
    assert expected.gain == pytest.approx(without.cost - fit.cost, rel=0.3)
    assert 0 < expected.beyond < expected.gain


def test_a_press_that_stands_still_gains_nothing_by_moving() -> None:
    problem = recorded()
    gains = [candidate.gain for candidate in moving(problem, problem.solve([], START))]
    assert max(gains, default=0.0) < 10.0


def test_a_fit_that_moves_is_counted_at_every_moment_of_its_scans_and_by_what_no_network_explains() -> None:
    problem = recorded(ScanSkew(3e-4))
    expected = moving(problem, problem.solve([], START))[0]
    moments = len(problem.linear.mixing(expected.term.effect))
    assert moments > 1
    linearised = []
    for term, moment_count in (([], 1), ([expected.term], moments)):
        before = problem.evidence.work.done
        problem.solve(term, START, steps=1)
        beyond = problem.last_leftover[1].size if problem.last_leftover else 0
        each = moment_count * problem.last_columns[0].size + beyond
        linearised.append((problem.evidence.work.done - before) / each)
    assert beyond > 0
    assert linearised == [2, 2]
