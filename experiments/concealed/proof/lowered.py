"""Which rules made which claims less sure: ``python experiments/concealed/proof/lowered.py RESULTS...``.

RESULTS are folders of opened samples. Of every rule among a claim's ``reasons`` that took something from its
confidence: how many such claims were right and how many wrong, and in how many recordings, for fields, contacts that
wander and others; a map is judged as the claim's confidence says it. Then, of what is measured rather than weighed
(limits of a converter, contacts that move) and that no rule lowered: in how many recordings all of it was right, in how
many not, which ``measured_confidence`` is set by.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import replace
from typing import Any

from judged import Judged
from opened_sample import asked_for

KINDS = {"piezo_inhomogeneity": "fields", "sheet_inhomogeneity": "fields", "contact_drift": "contacts that wander"}


def lowered(cases: list[Judged]) -> dict[tuple[str, str], dict[bool, list[int]]]:
    """By rule and kind of claim: numbers of the cases, one for every claim lowered, by whether it was right."""
    found: dict[tuple[str, str], dict[bool, list[int]]] = defaultdict(lambda: {True: [], False: []})
    for number, case in enumerate(cases):
        for claim in case.claims:
            for reason in claim.get("reasons") or []:
                if reason["after"] != reason["before"]:
                    kind = KINDS.get(claim["name"], "others")
                    asked = replace(case, where_known="confidence_everywhere" in claim)
                    found[reason["rule"], kind][asked.is_right(claim)].append(number)
    return found


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


def main() -> int:
    cases = asked_for(__doc__)
    print(f"{sum(bool(claim.get('reasons')) for case in cases for claim in case.claims)} claims with reasons\n")
    print("| rule | claims | right (recordings) | wrong (recordings) |")
    print("| --- | --- | --- | --- |")
    for (rule, kind), by_right in sorted(lowered(cases).items()):
        right, wrong = (f"{len(by_right[is_right])} ({len(set(by_right[is_right]))})" for is_right in (True, False))
        print(f"| `{rule}` | {kind} | {right} | {wrong} |")
    right_count, wrong_count = measured(cases)
    print(f"\nrecordings of what is measured, lowered by no rule: {right_count} all right, {wrong_count} not")
    return 0


if __name__ == "__main__":
    sys.exit(main())
