"""Which rules made which claims less sure: ``python experiments/concealed/proof/lowered.py RESULTS...``.

RESULTS are folders of opened samples. Of every rule among a claim's ``reasons`` that took something from its
confidence: how many such claims were right and how many wrong, and in how many recordings, for fields, contacts that
wander and others; a map is judged as the claim's confidence says it. The squares that their confidences missed by, and
would miss by without the rule, say what it is worth: an ablation that needs no run, but for claims that rules have
brought below what is said. Then, of what is measured rather than weighed (limits of a converter, contacts that move)
and that no rule lowered: in how many recordings all of it was right, in how many not, which ``measured_confidence`` is
set by.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import Any

from judged import Judged
from opened_sample import asked_for

from ertskin.diagnosis.judge.confidence import MAP_POWER

KINDS = {"piezo_inhomogeneity": "fields", "sheet_inhomogeneity": "fields", "contact_drift": "contacts that wander"}
POWER_OF = "maps"
"""The rule that takes a power of what it finds; all others take a share."""
SUREST = 0.99
"""The most that a claim's confidence would be without a rule."""


@dataclass(frozen=True)
class Lowered:
    """A claim of a case that a rule made less sure: what is ``said`` of it, and would be ``without`` the rule."""

    case: int
    right: bool
    said: float
    without: float


def lowered(cases: list[Judged]) -> dict[tuple[str, str], list[Lowered]]:
    """By rule and kind of claim."""
    found: dict[tuple[str, str], list[Lowered]] = defaultdict(list)
    for number, case in enumerate(cases):
        for claim in case.claims:
            reasons = claim.get("reasons") or []
            asked = replace(case, where_known="confidence_everywhere" in claim)
            for k, reason in enumerate(reasons):
                if reason["after"] != reason["before"]:
                    one = Lowered(number, asked.is_right(claim), reasons[-1]["after"], without(reasons, k))
                    found[reason["rule"], KINDS.get(claim["name"], "others")].append(one)
    return dict(found)


def without(reasons: list[dict[str, Any]], rule: int) -> float:
    """What a claim's confidence would be without the ``rule`` of this number: those after it take what they took."""
    value = float(reasons[rule]["before"])
    for reason in reasons[rule + 1 :]:
        if reason["rule"] == POWER_OF:
            value **= MAP_POWER
        elif reason["before"]:
            value *= reason["after"] / reason["before"]
    return min(SUREST, value)


def measured(cases: list[Judged]) -> tuple[int, int]:
    """In how many cases limits of a converter and contacts that move, lowered by no rule, were all right, in how many
    not."""
    found = {True: 0, False: 0}
    for case in cases:
        for is_kind in (_is_limit, _has_moved):
            mine = [claim for claim in case.claims if is_kind(claim) and not _is_lowered(claim)]
            if mine:
                found[all(case.is_right(claim) for claim in mine)] += 1
    return found[True], found[False]


def _is_limit(claim: dict[str, Any]) -> bool:
    return claim["name"] == "adc_saturation" and "limit_v" in claim["parameters"]


def _has_moved(claim: dict[str, Any]) -> bool:
    return bool(claim["name"] == "contact_drift")


def _is_lowered(claim: dict[str, Any]) -> bool:
    reasons = claim.get("reasons") or []
    return any(reason["rule"] != "rivals" and reason["after"] != reason["before"] for reason in reasons)


def _counted(claims: list[Lowered], right: bool) -> str:
    cases = [one.case for one in claims if one.right is right]
    return f"{len(cases)} ({len(set(cases))})"


def main() -> int:
    cases = asked_for(__doc__)
    print(f"{sum(bool(claim.get('reasons')) for case in cases for claim in case.claims)} claims with reasons\n")
    print("| rule | claims | right (recordings) | wrong (recordings) | squares missed | without the rule |")
    print("| --- | --- | --- | --- | --- | --- |")
    for (rule, kind), claims in sorted(lowered(cases).items()):
        missed = sum((one.said - one.right) ** 2 for one in claims)
        without = sum((one.without - one.right) ** 2 for one in claims)
        counts = f"{_counted(claims, True)} | {_counted(claims, False)}"
        print(f"| `{rule}` | {kind} | {counts} | {missed:.1f} | {without:.1f} |")
    right_count, wrong_count = measured(cases)
    print(f"\nrecordings of what is measured, lowered by no rule: {right_count} all right, {wrong_count} not")
    return 0


if __name__ == "__main__":
    sys.exit(main())
