"""By how much evidence is to be discounted: ``python experiments/concealed/proof/discount.py RESULTS...``.

RESULTS are folders of opened samples. Of every claim that is no field and that its rivals made less sure, how likely
whether it was right is by other values of ``evidence_discount`` than the one it was made by; what the rules took from
it stays, ``at_once`` too, though it counts evidence so as well. Contacts that wander, whose confidence is a number of
its own, are left out, and ties stay ties.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from judged import Judged
from opened_sample import asked_for

DISCOUNTS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0)
FIRST = 10.0
"""The discount of diagnoses that don't say theirs."""
SURE = 0.985
"""Confidence by the rivals from which on they say nothing."""
SUREST = 0.99
DRAWS = 4000
LEFT_OUT = ("piezo_inhomogeneity", "sheet_inhomogeneity", "contact_drift")
LEAST_REST = 1e-3
"""Odds of all rivals that aren't stated, from which on they count."""
CHANGED_BY = ("mending", "at_once")
"""Rules that add alternatives of their own."""


@dataclass(frozen=True)
class Doubted:
    """A claim that rivals made less sure: the half chi-square ``short`` by which each falls short, what the rules left
    of its confidence, that confidence as ``stated``, and whether it was right."""

    short: tuple[float, ...]
    factor: float
    stated: float
    right: bool

    def probability(self, discount: float) -> float:
        """Of being right, had evidence been discounted by this."""
        weights = np.exp(-np.maximum(self.short, 0.0) / discount)
        return float(min(SUREST, 1 / (1 + weights.sum())) * self.factor)


def doubted(case: Judged) -> Iterator[Doubted]:
    """Those of a case."""
    made_by = float((case.diagnosis.get("criteria") or {}).get("evidence_discount", FIRST))
    for claim in case.claims:
        by_rule = {reason["rule"]: float(reason["after"]) for reason in claim.get("reasons") or []}
        by_rivals = by_rule.get("rivals", 1.0)
        if claim["name"] not in LEFT_OUT and by_rivals < SURE:
            short = made_by * -np.log(_odds(claim, by_rivals, bool(set(CHANGED_BY) & set(by_rule))))
            stated = float(claim["confidence"])
            yield Doubted(tuple(short), stated / by_rivals, stated, case.is_right(claim))


def _odds(claim: dict[str, Any], confidence: float, changed: bool) -> Any:
    """(r,) odds of the rivals against the claim; those too unlikely to be stated, or mixed with others, count as
    so many alike as tie at most."""
    stated = [] if changed else [float(one["confidence"]) / confidence for one in claim.get("alternatives") or []]
    rest = 1 / confidence - 1 - sum(stated)
    alike = int(np.ceil(rest)) if rest > LEAST_REST else 0
    return np.minimum([*stated, *[rest / max(alike, 1)] * alike], 1.0)


def log_likelihood(claims: list[Doubted], discount: float) -> float:
    """In nats."""
    chance = [one.probability(discount) if one.right else 1 - one.probability(discount) for one in claims]
    return float(np.log(np.clip(chance, 0.01, 1.0)).sum())


def over_first(by_case: list[list[Doubted]], discount: float) -> tuple[float, float]:
    """By how much a discount is likelier than ``FIRST``, in nats: the middle 90 % of what cases drawn anew give."""
    gain = np.array([log_likelihood(one, discount) - log_likelihood(one, FIRST) for one in by_case])
    drawn = np.random.default_rng(0).integers(len(gain), size=(DRAWS, len(gain)))
    low, high = np.quantile(gain[drawn].sum(axis=1), [0.05, 0.95])
    return float(low), float(high)


def main() -> int:
    cases = asked_for(__doc__)
    by_case = [list(doubted(case)) for case in cases]
    found = [one for claims in by_case for one in claims]
    print(f"{len(found)} claims that rivals made less sure, {sum(one.right for one in found)} right\n")
    print(f"| discount | log-likelihood | over that of {FIRST:g}, cases drawn anew (90 %) | expected to be right |")
    print("| --- | --- | --- | --- |")
    for discount in DISCOUNTS:
        low, high = over_first(by_case, discount)
        expected = sum(one.probability(discount) for one in found)
        print(f"| {discount:g} | {log_likelihood(found, discount):.1f} | {low:.1f} to {high:.1f} | {expected:.1f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
