"""How likely maps were said to be right, and how often they are: ``python …/proof/said_of_maps.py RESULTS...``.

RESULTS are folders of opened samples. Of every field claimed where one of its name is hidden: the confidence that the
map is right over the whole sheet and the correlation with the true field there, and the same where the map says that it
is known (over the whole sheet where that is fewer than five sensing points; old diagnoses, which don't state both, say
how sure the name is). Below, how many are right, how many were expected to be, and the sum of squares that the
confidences missed by (Brier's score times their number).
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from judged import Judged
from opened_sample import asked_for


@dataclass(frozen=True)
class Said:
    """A map's confidence, its correlation with the true field, and whether that counts as right."""

    confidence: float
    correlation: float
    right: bool


@dataclass(frozen=True)
class Claim:
    """A field of a case, ``form`` as it is hidden: its map over the whole sheet and where it is known."""

    case: Judged
    name: str
    form: str
    everywhere: Said
    known: Said


def claims(cases: Iterable[Judged]) -> Iterator[Claim]:
    """Fields claimed where one of their name is hidden, the surest of each name."""
    for case in cases:
        for hidden in case.hidden:
            if "map" in hidden["details"] and (said := _said(case, hidden["name"])) is not None:
                known = _said(replace(case, where_known=True), hidden["name"])
                assert known is not None
                yield Claim(case, hidden["name"], hidden["form"], said, known)


def _said(case: Judged, name: str) -> Said | None:
    claim = next((one for one in case.claims if one["name"] == name), None)
    return claim and Said(float(claim["confidence"]), case.correlation(claim), case.is_right(claim))


def _cells(said: Said) -> str:
    follows = f"{said.correlation:.2f}"
    return f"{said.confidence:.2f} | {follows if said.right else f'**{follows}**'}"


def _summary(name: str, where: str, said: list[Said]) -> str:
    right = sum(one.right for one in said)
    missed = sum((one.confidence - one.right) ** 2 for one in said)
    expected = sum(one.confidence for one in said)
    return f"| `{name}` | {where} | {len(said)} | {expected:.1f} | {right} | {missed:.1f} |"


def main() -> int:
    found = list(claims(asked_for(__doc__)))
    print("| case | hidden, presses | over the sheet | follows by | where known | follows by |")
    print("| --- | --- | --- | --- | --- | --- |")
    for one in found:
        what = f"`{one.name}`, {one.form}, {one.case.truth['presses']}"
        print(f"| {one.case.name} | {what} | {_cells(one.everywhere)} | {_cells(one.known)} |")
    print("\n| effect | judged | maps | expected right | right | squares missed |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name in sorted({one.name for one in found}):
        print(_summary(name, "over the sheet", [one.everywhere for one in found if one.name == name]))
        print(_summary(name, "where known", [one.known for one in found if one.name == name]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
