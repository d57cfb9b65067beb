"""The score's rows: each a share with its Wilson interval, over all cases and in every form class."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from judged import LIKELY, Judged

MATERIAL = 1.05
STRONG, WEAK = 1.3, 1.075
CLASSES = ("same", "near", "different")
BINS = (0.0, 0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
Z95 = 1.959963984540054
DRAWS = 400
"""Times that cases are drawn anew for the calibration error's interval."""


@dataclass(frozen=True)
class Share:
    """Hits (halves count) of a number of cases, with Wilson's interval of 95 % (J. Am. Stat. Assoc. 22, 1927)."""

    hits: float
    count: int

    @property
    def value(self) -> float | None:
        """The share; ``None`` of nothing."""
        return self.hits / self.count if self.count else None

    @property
    def interval(self) -> tuple[float, float] | None:
        """Low and high."""
        if not self.count:
            return None
        n, p, z = self.count, self.hits / self.count, Z95
        middle = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
        return max(0.0, float(middle - half)), min(1.0, float(middle + half))

    def __str__(self) -> str:
        if self.value is None or self.interval is None:
            return "no case"
        low, high = self.interval
        return f"{100 * self.value:.1f} % ({self.hits:g}/{self.count}; {100 * low:.0f} to {100 * high:.0f})"


def share(items: Iterable[Any], mark: Callable[[Any], float | bool]) -> Share:
    """How many of the items are marked."""
    marks = [float(mark(item)) for item in items]
    return Share(sum(marks), len(marks))


@dataclass(frozen=True)
class Row:
    """A line of the table: over all, and by form class where that means something. ``wanted`` would be best."""

    label: str
    goal: str
    total: Share
    classes: dict[str, Share]
    wanted: float = 1.0

    @property
    def worst(self) -> tuple[str, Share] | None:
        """The form class that has a case and is farthest from what is wanted."""
        apart = {name: abs(one.value - self.wanted) for name, one in self.classes.items() if one.value is not None}
        name = max(apart, key=lambda one: apart[one], default=None)
        return None if name is None else (name, self.classes[name])


class FormClasses:
    """Same form as the model's, near it or different: by the share of the effect that the model's best fit leaves."""

    def __init__(self, left: dict[str, float]) -> None:
        self.left = left

    def of(self, name: str, form: str) -> str:
        """``same`` below 2 % left, ``near`` below 20 %, else ``different``; ``unmeasured`` without a measurement."""
        left = self.left.get(f"{name}/{form}")
        if left is None:
            return "unmeasured"
        return "same" if left < 0.02 else "near" if left < 0.2 else "different"

    def of_case(self, case: Judged) -> str:
        """The class of the least known effect hidden."""
        order = ("same", "near", "different", "unmeasured")
        found = [self.of(one["name"], one["form"]) for one in case.hidden]
        return max(found, key=order.index) if found else "none"

    def row(
        self,
        label: str,
        goal: str,
        cases: Sequence[Judged],
        mark: Callable[[Judged], float | bool],
        wanted: float = 1.0,
    ) -> Row:
        """A row over cases, split by class."""
        split = {name: share(group, mark) for name, group in self.split(cases).items()}
        return Row(label, goal, share(cases, mark), split, wanted)

    def split(self, cases: Sequence[Judged]) -> dict[str, list[Judged]]:
        """Cases in which a name is hidden, by class."""
        groups: dict[str, list[Judged]] = {}
        for case in cases:
            if case.hidden:
                groups.setdefault(self.of_case(case), []).append(case)
        return groups


def rows(cases: Sequence[Judged], classes: FormClasses) -> list[Row]:
    """Every row of the table of a suite."""
    nulls = [c for c in cases if c.is_null]
    single, compound = [c for c in cases if c.kind == "single"], [c for c in cases if c.kind == "compound"]
    family, hidden = [c for c in cases if c.kind == "family"], [c for c in cases if c.hidden]
    strong = [c for c in single if c.own_ratio >= STRONG]
    weak = [c for c in single if WEAK <= c.own_ratio < STRONG]
    named = [c for c in hidden if c.all_found]
    row = classes.row
    table = [
        row(
            "confident (0.9) wrong names, all cases",
            "at most 1 %, worst 3 %",
            cases,
            lambda c: bool(c.wrong_confident),
            0.0,
        ),
        row("false alarms on nulls", "0", nulls, _false_alarm, 0.0),
    ]
    for kind in sorted({c.kind for c in nulls}):
        table.append(row(f"the same, {kind}", "0", [c for c in nulls if c.kind == kind], _false_alarm, 0.0))
    table += [
        row(f"first name right, own ratio from {STRONG}", "97 %, worst 90 %", strong, lambda c: c.first_right),
        row(f"first name right, {WEAK} to {STRONG}", "85 %, worst 75 %", weak, lambda c: c.first_right),
        row(f"compounds: every name at {LIKELY} or more", "90 %, worst 80 %", compound, lambda c: c.all_found),
        row("families: unexplained or partly, no wrong name", "90 %", family, _left_unnamed),
        row(
            f"held out after at most {MATERIAL}, right names",
            "95 %, worst 90 %",
            named,
            lambda c: c.held_out("ratio_after") <= MATERIAL,
        ),
        _interval_row(hidden, classes),
        row("names nothing though something is hidden", "", hidden, lambda c: not c.likely, 0.0),
        row("no diagnosis, or cannot tell", "", cases, lambda c: c.verdict == "cannot_tell", 0.0),
    ]
    return table


def _false_alarm(case: Judged) -> bool:
    return case.verdict not in ("no_mismatch", "cannot_tell") or bool(case.likely)


def _left_unnamed(case: Judged) -> bool:
    return case.verdict in ("unexplained", "partly_explained") and not case.wrong_likely


def _interval_row(cases: Sequence[Judged], classes: FormClasses) -> Row:
    """Quantities with a meaning: one that isn't stated is a miss."""
    found = [one for case in cases for one in case.intervals()]
    split: dict[str, list[tuple[str, str, bool | None]]] = {}
    for one in found:
        split.setdefault(classes.of(one[0], one[1]), []).append(one)
    by_class = {name: share(group, lambda one: one[2] is True) for name, group in split.items()}
    return Row(
        "90 % intervals hold the truth",
        "85 to 95 %, worst 80 to 97 %",
        share(found, lambda one: one[2] is True),
        by_class,
        0.9,
    )


Claims = list[tuple[float, bool]]
Bins = list[dict[str, float]]


def reliability(cases: Sequence[Judged]) -> Bins:
    """Claims by confidence: count, mean confidence, share right."""
    return _binned([claim for case in cases for claim in _claims(case)])


def _claims(case: Judged) -> Claims:
    return [(float(one["confidence"]), case.is_right(one)) for one in case.claims]


def _binned(claims: Claims) -> Bins:
    table = []
    for low, high in pairwise(BINS):
        inside = [(c, r) for c, r in claims if low <= c < high or (high == 1.0 and c == 1.0)]
        if inside:
            mean, right = (float(np.mean(column)) for column in zip(*inside, strict=True))
            table.append({"low": low, "high": high, "count": len(inside), "confidence": mean, "right": right})
    return table


def calibration_error(table: Bins) -> float | None:
    """Expected calibration error: |confidence - right|, weighted by claims (Guo et al., ICML 2017)."""
    total = sum(part["count"] for part in table)
    return sum(part["count"] * abs(part["confidence"] - part["right"]) for part in table) / total if total else None


@dataclass(frozen=True)
class Calibration:
    """Expected calibration error of so many claims, with the middle 95 % of what cases drawn anew give."""

    error: float
    count: int
    interval: tuple[float, float]

    @classmethod
    def of(cls, cases: Sequence[Judged]) -> Calibration | None:
        """Over the claims of cases; ``None`` without a claim. Cases are drawn, for claims of one case go together."""
        said, rng = [_claims(case) for case in cases], np.random.default_rng(0)

        def error(numbers: Iterable[int]) -> float | None:
            return calibration_error(_binned([claim for k in numbers for claim in said[k]]))

        whole = error(range(len(said)))
        if whole is None:
            return None
        drawn = [error(rng.integers(len(said), size=len(said))) for _ in range(DRAWS)]
        low, high = np.quantile([one for one in drawn if one is not None], [0.025, 0.975])
        return cls(whole, sum(map(len, said)), (float(low), float(high)))

    def __str__(self) -> str:
        return f"{self.error:.3f} ({self.count} claims; {self.interval[0]:.3f} to {self.interval[1]:.3f})"


def calibrations(cases: Sequence[Judged], classes: FormClasses) -> dict[str, Calibration]:
    """Over ``all`` cases, and by form class; those with a claim."""
    found = {name: Calibration.of(group) for name, group in {"all": list(cases), **classes.split(cases)}.items()}
    return {name: one for name, one in found.items() if one is not None}
