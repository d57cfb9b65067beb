"""How sure a specimen's effects are of their parameters: presses count as independent, readings of one press do not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.judge.quantities import Spread
from ertskin.diagnosis.specimen.fit import SpecimenFinding
from ertskin.diagnosis.specimen.logarithmic import LogarithmicTest
from ertskin.physics.effects.effect import PiezoEffect

Array = NDArray[np.float64]

STEP = 1e-2
"""Of a parameter's typical size, for derivatives."""


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
    slope = np.stack([_slope(test, effects, k, key) for k, key in keys], axis=1)
    bread = np.linalg.pinv(slope.T @ slope)
    mine = press[test.fitted]
    pull = np.array([slope[mine == one].T @ residual[mine == one] for one in np.unique(mine)])
    robust = bread @ (pull.T @ pull) @ bread * len(pull) / max(len(pull) - 1, 1)
    white = bread * float((residual**2).mean())
    found = []
    for k, finding in enumerate(findings):
        rows = np.array([number for number, (owner, _) in enumerate(keys) if owner == k], dtype=np.intp)
        found.append(Spread(finding.free, tuple(np.asarray(c[rows[:, None], rows]) for c in (white, robust))))
    return tuple(found)


def _slope(test: LogarithmicTest, effects: Sequence[PiezoEffect], number: int, key: str) -> Array:
    """(n,) derivative of the residual by one parameter, the law fitted anew."""
    known, value = effects[number].parameters()[key], float(getattr(effects[number], key))
    step = STEP * known.typical
    low, high = max(value - step, known.low), min(value + step, known.high)

    def at(v: float) -> Array:
        return test.residual([e.changed({key: v}) if k == number else e for k, e in enumerate(effects)])

    return np.asarray((at(high) - at(low)) / (high - low))
