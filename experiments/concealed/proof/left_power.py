"""To what power the part of a misfit that a name explains says how sure it is.

``python …/proof/left_power.py RESULTS...``. RESULTS are folders of opened samples whose diagnoses took that part itself
(``thirtysecond48`` and all before it; later ones take a power of it, and their reasons don't tell which). Of every
claim that isn't a field and that ``left_over`` or ``left_beyond`` lowered: the logarithm of how likely it is that those
right are right and those wrong are wrong, and the squares that their confidences miss by, were that part taken to each
power. Claims of one recording, contacts that wander above all, are right or wrong together, which this doesn't know.
Then the rows of the score as the diagnoses said and with these claims' shares squared.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from judged import Judged
from lowered import KINDS, SUREST
from opened_sample import asked_for
from rows import FormClasses, calibration_error, reliability, rows

RULES = "left_over", "left_beyond"
POWERS = np.arange(0.0, 8.01, 0.5)
LEAST = 0.005
"""Confidence below which nothing is said."""


@dataclass(frozen=True)
class Lowered:
    """A claim of a ``kind``, which ``said`` how sure it is where it explains a ``share``, and whether it is right."""

    kind: str
    share: float
    said: float
    right: bool


def lowered(cases: Sequence[Judged]) -> list[Lowered]:
    """The claims that such rules made less sure, without fields."""
    found = []
    for case in cases:
        for claim in case.claims:
            if shares := _shares(claim):
                kind = "left_beyond" if "left_beyond" in shares else KINDS.get(claim["name"], "others")
                said = float(claim["confidence"])
                found.append(Lowered(kind, math.prod(shares.values()), said, case.is_right(claim)))
    return found


def _shares(claim: dict[str, Any]) -> dict[str, float]:
    """What each of the ``RULES`` that lowered a claim left of its confidence; nothing of a field."""
    if KINDS.get(claim["name"]) == "fields":
        return {}
    reasons = [one for one in claim.get("reasons") or [] if one["rule"] in RULES and 0 < one["after"] < one["before"]]
    return {one["rule"]: one["after"] / one["before"] for one in reasons}


def likely(claims: Sequence[Lowered], power: float) -> tuple[float, float]:
    """Log-likelihood of what is right and wrong, and squares missed, with shares to this power."""
    right = np.array([one.right for one in claims], float)
    sure = np.array([min(SUREST, one.said / one.share) * one.share**power for one in claims])
    sure = np.clip(sure, LEAST, SUREST)
    return float(np.log(np.where(right > 0, sure, 1 - sure)).sum()), float(((sure - right) ** 2).sum())


def squared(case: Judged) -> Judged:
    """The case with the shares of such claims squared in what its diagnosis says."""
    effects = [_squared(one) for one in case.diagnosis.get("effects") or []]
    return replace(case, diagnosis={**case.diagnosis, "effects": effects})


def _squared(claim: dict[str, Any]) -> dict[str, Any]:
    share = math.prod(_shares(claim).values())
    stated = {key: share * claim[key] for key in ("confidence", "confidence_everywhere") if key in claim}
    return {**claim, **stated}


def main() -> int:
    cases = asked_for(__doc__)
    claims = lowered(cases)
    print("| claims | right | wrong | likeliest power | within half a nat | by 1: nats, squares missed | by 2 |")
    print("| --- " * 7 + "|")
    for kind in dict.fromkeys(sorted(one.kind for one in claims)):
        mine = [one for one in claims if one.kind == kind]
        nats = np.array([likely(mine, power)[0] for power in POWERS])
        near = POWERS[nats > nats.max() - 0.5]
        right = sum(one.right for one in mine)
        cells = [f"{nat:.1f}, {square:.1f}" for nat, square in (likely(mine, 1.0), likely(mine, 2.0))]
        best = f"{POWERS[nats.argmax()]:g} | {near.min():g} to {near.max():g}"
        print(f"| {kind} | {right} | {len(mine) - right} | {best} | {' | '.join(cells)} |")
    after = [squared(case) for case in cases]
    print("\n| | as said | squared |\n| --- | --- | --- |")
    for said, then in zip(rows(cases, FormClasses({})), rows(after, FormClasses({})), strict=True):
        if said.total != then.total:
            print(f"| {said.label} | {said.total.hits:g}/{said.total.count} | {then.total.hits:g}/{then.total.count} |")
    errors = [calibration_error(reliability(each)) or 0.0 for each in (cases, after)]
    print(f"| calibration error | {errors[0]:.3f} | {errors[1]:.3f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
