"""Contacts that wander: their paths are measured at rest, so they are calibrated away first and claimed afterwards."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import Claim
from ertskin.diagnosis.search.selection import Selection
from ertskin.physics.effects.effect import ElectrodeEffect
from ertskin.physics.effects.hypothesis import Measured

Array = NDArray[np.float64]


def drift_claims(selection: Selection, settling: Collection[int] = ()) -> list[Claim]:
    """The drifts, the largest first, until the others together are no longer material; those of electrodes that are
    ``settling`` however little they do: each is sure along the course of all."""
    drifts = [
        effect
        for effect in selection.after.effects
        if isinstance(effect, ElectrodeEffect) and effect.hypothesis.measured == Measured.CONTACT_PATH
    ]
    if not drifts:
        return []
    problem, solved = selection.problem, selection.after
    criteria = problem.evidence.criteria
    column = problem.contact_columns(problem.family.skin(solved.calibration, solved.effects))
    time_s, used = problem.evidence.history.time_s, problem.weight > 0

    calibrated = np.broadcast_to(solved.calibration.contact_ohm, (len(time_s), column.shape[-1]))

    def off(drift: ElectrodeEffect) -> Array:
        share = drift.contact_resistance_ohm(calibrated, np.zeros(calibrated.shape), time_s) / calibrated - 1
        return np.einsum("tpl,tl->tp", column[used], share[used])

    parts = sorted(((off(drift), drift) for drift in drifts), key=lambda part: -_misfit(part[0]))
    claims = []
    left = np.sum([wrong for wrong, _ in parts], axis=0)
    for wrong, drift in parts:
        if _misfit(left) < criteria.material_ratio and drift.value("electrode") not in settling:
            continue
        claims.append(Claim(drift, criteria.drift_confidence, _misfit(wrong), {}))
        left = left - wrong
    return claims


def _misfit(wrong: Array) -> float:
    """Rms over noise of what would be off by this much."""
    return float(np.sqrt(1 + (wrong**2).mean()))
