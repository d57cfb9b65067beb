"""How sure a specimen's effects are of their parameters: presses count as independent, readings of one press do not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.judge.quantities import Spread
from ertskin.diagnosis.specimen.fit import SpecimenFinding, slope
from ertskin.diagnosis.specimen.logarithmic import LogarithmicTest

Array = NDArray[np.float64]


def spreads_of(
    test: LogarithmicTest, findings: Sequence[SpecimenFinding], press: NDArray[np.intp]
) -> tuple[Spread, ...]:
    """Each effect's free parameters and their covariance, all fitted together (Liang and Zeger 1986).

    ``press`` (N,) numbers each reading's press.
    """
    effects = [finding.effect for finding in findings]
    keys = [(k, key) for k, finding in enumerate(findings) for key in finding.free]
    if not keys:
        return ()
    residual = test.residual(effects)
    columns = np.stack([slope(test, effects, k, key) for k, key in keys], axis=1)
    bread = np.linalg.pinv(columns.T @ columns)
    mine = press[test.fitted]
    pull = np.array([columns[mine == one].T @ residual[mine == one] for one in np.unique(mine)])
    robust = bread @ (pull.T @ pull) @ bread * len(pull) / max(len(pull) - 1, 1)
    white = bread * float((residual**2).mean())
    found = []
    for k, finding in enumerate(findings):
        rows = np.array([number for number, (owner, _) in enumerate(keys) if owner == k], dtype=np.intp)
        found.append(Spread(finding.free, tuple(np.asarray(c[rows[:, None], rows]) for c in (white, robust))))
    return tuple(found)
