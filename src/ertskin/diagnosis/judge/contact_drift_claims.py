"""Contacts that wander: their paths are measured at rest, so they are calibrated away first and claimed afterwards."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import Claim
from ertskin.diagnosis.search.chosen import Selection
from ertskin.diagnosis.search.contact_paths import changed_by_paths

Array = NDArray[np.float64]


def drift_claims(selection: Selection, settling: Collection[int] = ()) -> list[Claim]:
    """The drifts, the largest first, until the others together are no longer material; those of electrodes that are
    ``settling`` however little they do: each is sure along the course of all."""
    problem, solved = selection.problem, selection.after
    criteria, used = problem.evidence.criteria, problem.weight > 0
    parts = [(part[used], drift) for drift, part in changed_by_paths(problem, solved)]
    if not parts:
        return []
    parts.sort(key=lambda part: -_misfit(part[0]))
    claims = []
    left = np.sum([wrong for wrong, _ in parts], axis=0)
    for wrong, drift in parts:
        if _misfit(left) < criteria.material_ratio and drift.value("electrode") not in settling:
            continue
        claims.append(Claim(drift, criteria.measured_confidence, _misfit(wrong), {}))
        left = left - wrong
    return claims


def _misfit(wrong: Array) -> float:
    """Rms over noise of what would be off by this much."""
    return float(np.sqrt(1 + (wrong**2).mean()))
