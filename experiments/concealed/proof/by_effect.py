"""Which effects are found: of every named effect how often it was hidden and told, alone and in compounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from judged import LIKELY, Judged
from rows import WEAK, Share, share


@dataclass(frozen=True)
class Found:
    """How often an effect of own ratio ``WEAK`` or more was told, at its place, in cases where it was hidden; and in
    how many of all cases it is named at a wrong place (or with a wrong map), and where it isn't hidden."""

    name: str
    alone: Share
    compound: Share
    misplaced: int
    absent: int

    @property
    def either(self) -> Share:
        """Alone or in compounds."""
        return Share(self.alone.hits + self.compound.hits, self.alone.count + self.compound.count)

    def __str__(self) -> str:
        alone, compound = (f"{one.hits:g}/{one.count}" for one in (self.alone, self.compound))
        return (
            f"| `{self.name}` | {alone} | {compound} | {self.either} | {self.misplaced or ''} | {self.absent or ''} |"
        )


def by_effect(cases: Sequence[Judged]) -> list[str]:
    """The table, line by line."""
    caption = (
        f"Of effects whose own ratio is {WEAK} or more, told at {LIKELY} or more and at their place;"
        " named wrongly in how many of all cases:"
    )
    head = "| effect | alone | in compounds | either | at a wrong place | not hidden |"
    return [caption, "", head, "|" + " --- |" * 6, *map(str, found(cases))]


def found(cases: Sequence[Judged]) -> list[Found]:
    """Of every name that is hidden somewhere, the best told first."""
    names = sorted({one["name"] for case in cases for one in case.hidden})
    return sorted((_found(cases, name) for name in names), key=lambda one: -(one.either.value or 0.0))


def _found(cases: Sequence[Judged], name: str) -> Found:
    def is_named(case: Judged) -> bool:
        return any(claim["name"] == name and case.is_right(claim) for claim in case.likely)

    def is_shown(case: Judged) -> bool:
        hidden = case.truth_of(name)
        return hidden is not None and float(hidden["own"]) >= WEAK

    shown = [case for case in cases if is_shown(case)]
    alone, compound = ([case for case in shown if (case.kind == "single") is one] for one in (True, False))
    wrong = [case for case in cases if name in case.wrong_likely]
    misplaced = sum(case.truth_of(name) is not None for case in wrong)
    return Found(name, share(alone, is_named), share(compound, is_named), misplaced, len(wrong) - misplaced)
