"""Samples side by side and together: ``python experiments/concealed/proof/track_record.py SAMPLE ... --out DIR``.

Every SAMPLE is a folder of results that ``score.py`` can judge; its seals are checked first. Each was diagnosed by the
code of its own day: together they say how often an answer was right when it was given, not how good the last code is.
The last of them, as many as a whole suite has cases, come nearer to that. The last table says which effects all found.
Writes DIR/track_record.md and DIR/track_record.png, stated confidence against how often it was right.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

import seals
from by_effect import by_effect
from judged import DiagnosisError, Judged
from opened_sample import METHOD, judged, opened
from rows import Calibration, FormClasses, Row, calibration_error, reliability, rows
from score import draw

COLUMNS = {
    "false alarms on nulls": "nulls",
    "confident (0.9) wrong names, all cases": "confident wrong",
    "first name right, own ratio from 1.3": "from 1.3",
    "first name right, 1.075 to 1.3": "1.075 to 1.3",
    "compounds: every name at 0.5 or more": "compounds",
    "families: unexplained or partly, no wrong name": "families",
    "held out after at most 1.05, right names": "held out",
    "90 % intervals hold the truth": "intervals",
    "names nothing though something is hidden": "nothing named",
}
"""Rows of the score that are columns, and their heads."""
ENOUGH = 300
"""Cases that the last samples have at least, about as many as a suite."""


def line(name: str, cases: list[Judged]) -> str:
    """A sample's row of the table, its calibration error last."""
    by_label = {row.label: row for row in rows(cases, FormClasses({}))}
    shares = [f"{by_label[label].total.hits:g}/{by_label[label].total.count}" for label in COLUMNS]
    error = calibration_error(reliability(cases))
    return f"| {' | '.join((name, *shares, 'no claim' if error is None else f'{error:.3f}'))} |"


def last_of(by_sample: Mapping[str, list[Judged]]) -> list[str]:
    """The last samples that have ``ENOUGH`` cases together, or all."""
    found, count = list[str](), 0
    for name in reversed(by_sample):
        if count >= ENOUGH:
            break
        found.insert(0, name)
        count += len(by_sample[name])
    return found


def together(by_head: Mapping[str, list[Judged]]) -> list[str]:
    """Every row over the cases of each head, with its interval."""
    kept: list[list[Row]] = [
        [row for row in rows(cases, FormClasses({})) if row.label in COLUMNS] for cases in by_head.values()
    ]
    lines = [
        f"| {alike[0].label} | {alike[0].goal} | {' | '.join(str(row.total) for row in alike)} |"
        for alike in zip(*kept, strict=True)
    ]
    errors = " | ".join(str(Calibration.of(cases) or "no claim") for cases in by_head.values())
    lines.append(f"| of names at p, p right (expected calibration error) | 0.03 | {errors} |")
    return [f"| | wanted | {' | '.join(by_head)} |", "|" + " --- |" * (2 + len(by_head)), *lines]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("samples", type=Path, nargs="+", help="folders of results, in the order of the table")
    parser.add_argument("--out", type=Path, required=True, help="folder for the table and the figure")
    options = parser.parse_args()
    try:
        by_sample = {one.name: judged(one, opened(one))[METHOD] for one in options.samples}
    except (seals.SealError, DiagnosisError) as error:
        print(error, file=sys.stderr)
        return 2
    every = [case for cases in by_sample.values() for case in cases]
    heads = " | ".join(("sample", *COLUMNS.values(), "calibration error"))
    lines = [f"# {len(by_sample)} samples, {len(every)} cases, all seals hold", "", f"| {heads} |"]
    lines += ["|" + " --- |" * (len(COLUMNS) + 2), *(line(name, cases) for name, cases in by_sample.items()), ""]
    last = last_of(by_sample)
    recent = [case for name in last for case in by_sample[name]]
    by_head = {"together": every, f"the last {len(last)} ({len(recent)} cases)": recent}
    lines += [*together(by_head), "", *by_effect(every)]
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "track_record.md").write_text("\n".join(lines) + "\n")
    draw({METHOD: {"reliability": reliability(every)}}, options.out / "track_record.png")
    print("\n".join(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
