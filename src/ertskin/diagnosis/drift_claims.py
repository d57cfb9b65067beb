"""Contacts that wander: their paths are measured at rest, so they are calibrated away first and claimed afterwards."""

from __future__ import annotations

import numpy as np

from ertskin.diagnosis.claims import Claim
from ertskin.diagnosis.selection import Selection
from physics.effects.contact_drift import ContactDrift

MATERIAL = 1.03
SURE = 0.85
"""Confidence: that the contact moved is measured, why it did isn't."""


def drift_claims(selection: Selection) -> list[Claim]:
    """The drifts without which the readings would be off by more than ``MATERIAL``, each contact by itself."""
    drifts = [effect for effect in selection.after.effects if isinstance(effect, ContactDrift)]
    if not drifts:
        return []
    problem, solved = selection.problem, selection.after
    column = problem.contact_columns(problem.family.skin(solved.calibration, solved.effects))
    time_s = problem.evidence.history.time_s
    claims = []
    for drift in drifts:
        share = np.interp(time_s, drift.knot_s, drift.ohm) / solved.calibration.contact_ohm[drift.electrode]
        wrong = column[..., drift.electrode] * share[:, None]
        alone = float(np.sqrt(1 + (wrong[problem.weight > 0] ** 2).mean()))
        if alone > MATERIAL:
            claims.append(Claim(drift, SURE, alone, {}))
    return claims
