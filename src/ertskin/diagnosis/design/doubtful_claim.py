"""Which claim is in doubt, and the press that would settle it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ertskin.diagnosis.contract.claims import Claim, Rival
from ertskin.diagnosis.design.next_press import Feasible, next_press
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.physics.effects.effect import MotionEffect
from ertskin.physics.skin import Skin

SETTLED = 0.9
"""Confidence from which a claim needs no further press."""
SERIOUS = 25.0
"""Half chi-square by which a rival may fall short and still be worth a press."""


def doubted(claims: Sequence[Claim]) -> tuple[Claim, Rival] | None:
    """The least settled claim that has a serious rival, and the nearest of its rivals.

    Presses are designed by what readings and the foam's force tell: a stage that moves while the load cell is read is
    no rival there.
    """
    for claim in sorted((c for c in claims if c.in_readings), key=lambda c: c.confidence):
        serious = (r for r in claim.rivals if r.short < SERIOUS)
        still = (r for r in serious if not (claim.by_force and isinstance(r.effect, MotionEffect)))
        rivals = sorted(still, key=lambda r: r.short)
        if claim.confidence < SETTLED and rivals:
            return claim, rivals[0]
    return None


def settling_press(
    evidence: Evidence, skin: Skin, force_noise_n: float, claims: Sequence[Claim]
) -> dict[str, Any] | None:
    """``next_press`` of the contract, for the fitted ``skin``; None where nothing is in doubt or no press would tell.

    A rival takes the claim's place among the skin's effects. A press that moves during its scan is left standing still
    unless that is in doubt itself: it would take every frame several solutions and tells nothing of the others.
    """
    found = doubted(claims)
    if found is None:
        return None
    claim, rival = found
    gone = (claim.effect.name, rival.effect.name)
    others = [e for e in skin.effects if e.name not in gone and not isinstance(e, MotionEffect)]
    own = replace(skin, effects=(*others, claim.effect))
    foreign = {rival.effect.name: replace(skin, effects=(*others, rival.effect))}
    feasible = Feasible.of(evidence.sensor, evidence.history)
    return next_press(own, foreign, evidence.noise_v, force_noise_n, feasible, claim.effect.name)
