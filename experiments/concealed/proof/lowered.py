"""Which rules made which claims less sure: ``python experiments/concealed/proof/lowered.py RESULTS...``.

RESULTS are folders of opened samples. Of every rule among a claim's ``reasons`` that took something from its
confidence: how many such claims were right and how many wrong, and in how many recordings, for fields, contacts that
wander and others.
"""

from __future__ import annotations

import sys
from collections import defaultdict

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
                    found[reason["rule"], kind][case.is_right(claim)].append(number)
    return found


def main() -> int:
    cases = asked_for(__doc__)
    print(f"{sum(bool(claim.get('reasons')) for case in cases for claim in case.claims)} claims with reasons\n")
    print("| rule | claims | right (recordings) | wrong (recordings) |")
    print("| --- | --- | --- | --- |")
    for (rule, kind), by_right in sorted(lowered(cases).items()):
        right, wrong = (f"{len(by_right[is_right])} ({len(set(by_right[is_right]))})" for is_right in (True, False))
        print(f"| `{rule}` | {kind} | {right} | {wrong} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
