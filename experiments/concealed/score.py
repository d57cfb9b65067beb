"""Open the seals and score: ``python experiments/concealed/score.py OUT`` writes ``score.md``, ``.json``, a figure.

The scores are fixed here, before any diagnosis runs. Every folder under ``OUT/diagnoses`` is a method, a row each.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta
from verdicts import CONFIDENT, LIKELY, DiagnosisError, Judged, open_case

from ertskin.hardware.virtual.bench.sealing import SealError

Number = float | None
BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)
FIRST_COLUMNS = ("no_mismatch", "unexplained", "cannot_tell")
MATERIAL = 1.05
"""Held-out ratio above which a mismatch is reported."""
STRENGTHS = ((1.0, 1.075), (1.075, 1.3), (1.3, 2.0), (2.0, np.inf))


def share(cases: Iterable[Any], right: Callable[[Any], bool]) -> dict[str, Number]:
    """How many of the cases or claims, as a share with a Clopper-Pearson interval of 95 %; null where there is none."""
    marks = [bool(right(case)) for case in cases]
    hits, count = sum(marks), len(marks)
    if not count:
        return {"hits": 0, "count": 0, "share": None, "low": None, "high": None}
    low = float(beta.ppf(0.025, hits, count - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, count - hits)) if hits < count else 1.0
    return {"hits": hits, "count": count, "share": hits / count, "low": low, "high": high}


def median(values: Iterable[float]) -> Number:
    """The median of what is a number; null where nothing is."""
    known = [value for value in values if np.isfinite(value)]
    return float(np.median(known)) if known else None


def electrode_scores(cases: Sequence[Judged]) -> dict[str, Any]:
    """Precision, recall and F1 of the electrodes pointed at, where an effect sits at one."""
    local = [case for case in cases if case.true_electrode is not None]
    said = sum(len(case.electrodes_said) for case in local)
    right = sum(case.true_electrode in case.electrodes_said for case in local)
    f1 = 2 * right / (said + len(local)) if local else None
    pointing = [case for case in local if case.electrodes_said]
    return {"f1": f1, "wrong": share(pointing, lambda case: case.true_electrode not in case.electrodes_said)}


def reliability(cases: Sequence[Judged]) -> list[dict[str, Number]]:
    """Claims by confidence: how many there are, their mean confidence, and how many of them are right."""
    claims = [(one["confidence"], case.is_right(one)) for case in cases for one in case.claims]
    table = []
    for low, high in pairwise(BINS):
        inside = [(c, right) for c, right in claims if low <= c < high or (high == 1.0 and c == 1.0)]
        mean = [float(np.mean(column)) for column in zip(*inside, strict=True)] if inside else [None, None]
        table.append({"low": low, "high": high, "count": len(inside), "confidence": mean[0], "right": mean[1]})
    return table


def parameter_scores(cases: Sequence[Judged]) -> dict[str, Any]:
    """Relative error and coverage of the 90 % intervals, over all and by parameter."""
    found = [row for case in cases for row in case.parameter_errors()]
    by_name = {
        name: {
            "count": sum(row[0] == name for row in found),
            "median_error": median(abs(row[1]) for row in found if row[0] == name),
            "coverage": float(np.mean([row[2] for row in found if row[0] == name])),
        }
        for name in sorted({row[0] for row in found})
    }
    return {
        "count": len(found),
        "median_error": median(abs(row[1]) for row in found),
        "coverage": float(np.mean([row[2] for row in found])) if found else None,
        "by_parameter": by_name,
    }


def score(cases: Sequence[Judged], recorded: int) -> dict[str, Any]:
    """Every column of the study for one method, on the cases it diagnosed of those ``recorded``."""
    nulls = [case for case in cases if case.is_null]
    single = [case for case in cases if len(case.truth.effects) == 1 and case.listed and case.kind != "blind"]
    several = [case for case in cases if len(case.listed) > 1]
    unlisted = [case for case in cases if case.truth.effects and not case.listed]
    named = [case for case in single + several if case.top_right]
    seen = [case for case in named if case.held_out("ratio_before") > MATERIAL]
    hidden = [case for case in cases if not case.is_null and case.kind != "blind"]
    distances = [case.distance_m for case in cases if case.distance_m is not None]
    return {
        "cases": f"{len(cases)}/{recorded}",
        "confident_wrong": {case.name: case.confident_wrong for case in cases if case.confident_wrong},
        "confident_wrong_share": share(cases, lambda case: bool(case.confident_wrong)),
        "confident_wrong_unlisted": share(unlisted, lambda case: bool(case.confident_wrong)),
        "false_alarms": share(nulls, lambda case: case.verdict not in ("no_mismatch", "cannot_tell")),
        "top_one": {
            f"{low:g} to {high:g}": share([c for c in single if low <= c.own_ratio < high], lambda case: case.top_right)
            for low, high in STRENGTHS
        },
        "set": share(single, lambda case: case.set_right),
        "all_found": share(several, lambda case: case.all_found),
        "all_likely": share(several, lambda case: case.all_likely),
        "likely_right": share([mark for case in cases for mark in case.likely], bool),
        "twins_top_one": share([c for c in single if c.kind == "twin"], lambda case: case.top_right),
        "behind_all_found": share([c for c in several if c.kind == "concealed"], lambda case: case.all_found),
        "unlisted_unexplained": share(unlisted, lambda c: c.verdict in ("unexplained", "partly_explained")),
        "blind_not_wrong": share([c for c in cases if c.kind == "blind"], lambda case: not case.confident_wrong),
        "abstention": share(hidden, lambda case: not case.claims),
        "ratio_before": median(case.held_out("ratio_before") for case in hidden),
        "ratio_after": median(case.held_out("ratio_after") for case in hidden),
        "ratio_after_low": share(named, lambda case: case.held_out("ratio_after") <= MATERIAL),
        "ratio_after_low_seen": share(seen, lambda case: case.held_out("ratio_after") <= MATERIAL),
        "electrode": electrode_scores(cases),
        "distance_m": median(distances),
        "parameters": parameter_scores(cases),
        "reliability": reliability(cases),
        "confusion": {
            row: dict(Counter(case.column for case in cases if case.row == row))
            for row in sorted({case.row for case in cases})
        },
    }


def _percent(part: dict[str, Number]) -> str:
    if part["share"] is None or part["low"] is None or part["high"] is None:
        return "none"
    interval = f"{100 * part['low']:.0f} to {100 * part['high']:.0f} %"
    return f"{100 * part['share']:.0f} % ({part['hits']:g}/{part['count']:g}; {interval})"


def _number(value: Number, scale: float = 1.0, digits: int = 3) -> str:
    return "none" if value is None else f"{scale * value:.{digits}g}"


def rows(one: dict[str, Any]) -> list[tuple[str, str]]:
    """The table's lines for one method, worst news first."""
    lines = [
        ("diagnosed", one["cases"]),
        (f"confident wrong names (at {CONFIDENT:g} or more)", _percent(one["confident_wrong_share"])),
        ("the same, effects in no list", _percent(one["confident_wrong_unlisted"])),
        ("false alarms on nulls", _percent(one["false_alarms"])),
    ]
    lines += [(f"top name right, own ratio {bounds}", _percent(part)) for bounds, part in one["top_one"].items()]
    lines += [
        ("true name in the set", _percent(one["set"])),
        ("compounds: all found", _percent(one["all_found"])),
        (f"compounds: all found at {LIKELY:g} or more", _percent(one["all_likely"])),
        (f"names at {LIKELY:g} or more that are right", _percent(one["likely_right"])),
        ("behind a stronger effect: all found", _percent(one["behind_all_found"])),
        ("near-twins: top name right", _percent(one["twins_top_one"])),
        ("in no list: unexplained or partly", _percent(one["unlisted_unexplained"])),
        ("blind protocols: no confident wrong name", _percent(one["blind_not_wrong"])),
        ("names nothing though something is hidden", _percent(one["abstention"])),
        ("held-out ratio before, median", _number(one["ratio_before"])),
        ("held-out ratio after, median", _number(one["ratio_after"])),
        (f"held-out ratio after at most {MATERIAL:g}, right names", _percent(one["ratio_after_low"])),
        (f"the same, where it was above {MATERIAL:g} before", _percent(one["ratio_after_low_seen"])),
        ("electrode F1", _number(one["electrode"]["f1"])),
        ("wrong electrode", _percent(one["electrode"]["wrong"])),
        ("place, median error (mm)", _number(one["distance_m"], 1e3)),
        ("parameter, median relative error", _number(one["parameters"]["median_error"])),
        ("90 % intervals that hold the truth", _number(one["parameters"]["coverage"], 100.0) + " %"),
    ]
    return lines


def markdown(scores: dict[str, dict[str, Any]]) -> str:
    """The score as a page: confident wrong names, the table, the confusion matrix of each method."""
    page = ["# Score", "", "## Confident wrong names", ""]
    wrong = [
        f"- {method}, {case}: {', '.join(n)}"
        for method, s in scores.items()
        for case, n in s["confident_wrong"].items()
    ]
    page += [*(wrong or ["None."]), "", "## Table", ""]
    tables = {method: rows(one) for method, one in scores.items()}
    page += ["| | " + " | ".join(tables) + " |", "| --- |" + " --- |" * len(tables)]
    for number, (label, _) in enumerate(next(iter(tables.values()))):
        page.append(f"| {label} | " + " | ".join(table[number][1] for table in tables.values()) + " |")
    for method, one in scores.items():
        page += ["", f"## Confusion, {method}", "", *_confusion(one["confusion"])]
    return "\n".join(page) + "\n"


def _confusion(confusion: dict[str, dict[str, int]]) -> list[str]:
    said = {column for counts in confusion.values() for column in counts}
    columns = [*FIRST_COLUMNS, *sorted(said - set(FIRST_COLUMNS))]
    lines = ["| hidden | " + " | ".join(columns) + " |", "| --- |" + " --- |" * len(columns)]
    for row, counts in confusion.items():
        lines.append(f"| {row} | " + " | ".join(str(counts.get(column, "")) for column in columns) + " |")
    return lines


def draw_reliability(scores: dict[str, dict[str, Any]], path: Path) -> None:
    """Confidence against how often it was right, one line a method."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5, 5), layout="constrained")
    axes.plot([0, 1], [0, 1], color="0.7", label="calibrated")
    for method, one in scores.items():
        filled = [part for part in one["reliability"] if part["count"]]
        if not filled:
            continue
        line = axes.plot([p["confidence"] for p in filled], [p["right"] for p in filled], marker="o", label=method)
        for part in filled:
            at, color = (part["confidence"], part["right"]), line[0].get_color()
            axes.annotate(f"{part['count']:g}", at, (4, -12), textcoords="offset points", color=color)
    axes.set(xlabel="stated confidence", ylabel="share of claims that were right", xlim=(0, 1.02), ylim=(-0.02, 1.02))
    axes.legend()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder of the suite")
    out: Path = parser.parse_args().out
    names = sorted(path.name.split(".")[0] for path in (out / "recordings").glob("*.seal.json"))
    methods = sorted(path.name for path in (out / "diagnoses").glob("*") if path.is_dir())
    try:
        judged = {m: [case for case in (open_case(name, out, m) for name in names) if case] for m in methods}
    except (SealError, DiagnosisError) as error:
        print(error, file=sys.stderr)
        return 2
    scores = {method: score(cases, len(names)) for method, cases in judged.items() if cases}
    if not scores:
        print(f"{out}: nothing diagnosed yet", file=sys.stderr)
        return 2
    page = markdown(scores)
    (out / "score.md").write_text(page)
    (out / "score.json").write_text(json.dumps(scores, indent=1) + "\n")
    draw_reliability(scores, out / "reliability.png")
    print(page)
    return 0


if __name__ == "__main__":
    sys.exit(main())
