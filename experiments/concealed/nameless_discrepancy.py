"""A discrepancy without a name, added to the calibrated simulator.

Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425. It names nothing. How well it
predicts presses held out is the yardstick of what a name explains beyond that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from ertskin.diagnosis.contract.claims import Diagnosis
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.judge.held_out import ratio
from ertskin.diagnosis.judge.remainder import remainder
from ertskin.diagnosis.judge.result import Findings
from ertskin.diagnosis.linear.calibration_vector import Calibration
from ertskin.diagnosis.search.chosen import Selection

Report = Callable[[float | None, str], None]
Problem = Callable[[Solved | None], VoltageProblem]


def by_nothing(
    build: Problem,
    fixed: Sequence[Term],
    begun: Sequence[tuple[Term, object]],
    start: Calibration,
    partitions: Sequence[Sequence[int]],
    report: Report,
) -> Selection:
    """The calibrated simulator and no effect: what it leaves is for ``nameless`` to predict."""
    problem = build(None)
    before = problem.solve(fixed, start)
    return Selection(before, before, (), problem, ())


def nameless(findings: Findings) -> Diagnosis:
    """The diagnosis of a selection of no effect, with a Gaussian process of place, force, history and time for what the
    simulator leaves: ``no_mismatch`` or ``unexplained``, no names; it has no confidence."""
    said, selection = findings.diagnosis, findings.selection
    if selection is None or findings.held is None or findings.residual_after is None:
        return said
    problem = selection.problem
    elsewhere = problem.linear.history[findings.held]
    expected = remainder(problem.evidence.history, selection.after.scan_residual, elsewhere)
    left = ratio(findings.residual_after - expected)
    verdict = "no_mismatch" if said.verdict == "no_mismatch" else "unexplained"
    return replace(
        said,
        verdict=verdict,
        held_out=replace(said.held_out, ratio_after=left, p_value=None),
        claims=(),
        of_all_presses=None,
        unexplained_ratio=left,
        remainder_ratio=left,
    )
