"""Recompute a seed's score from what is committed: ``python experiments/concealed/proof/score.py RESULTS``.

RESULTS is ``experiments/concealed/results/seedN``. Every seal is checked first: the secret against its hash, every
nonce against the secret, every truth against its seal, the cases against those the secret draws. ``--recordings DIR``
checks the recordings' bytes too. Writes score.md, score.json and reliability.png there.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import seals
from judged import FEWEST_KNOWN, DiagnosisError, Judged
from opened_sample import judged, opened
from rows import Calibration, FormClasses, Row, Share, calibrations, reliability, rows

LEFT = "isolated_laws.json"
"""What the model that diagnosed left of every form: the classes of forms."""
Scores = dict[str, dict[str, Any]]


def _cell(row: Row) -> str:
    worst = row.worst
    return f"{row.label} | {row.goal} | {row.total} | " + (f"{worst[0]}: {worst[1]}" if worst else "")


def _calibration_line(found: dict[str, Calibration]) -> str:
    by_class = {name: one for name, one in found.items() if name != "all"}
    name = max(by_class, key=lambda one: by_class[one].error, default="")
    worst = f"{name}: {by_class[name]}" if name else ""
    return f"| of names at p, p right (expected calibration error) | 0.03 | {found.get('all', 'no claim')} | {worst} |"


def _numbers(share: Share) -> dict[str, Any]:
    return {"hits": share.hits, "count": share.count, "interval": share.interval}


def page(method: str, cases: list[Judged], classes: FormClasses) -> tuple[str, dict[str, Any]]:
    """The table of one method as text, and its numbers."""
    table, found = rows(cases, classes), calibrations(cases, classes)
    lines = [f"## {method}", "", "| | wanted | all | worst form class |", "| --- | --- | --- | --- |"]
    lines += [f"| {_cell(row)} |" for row in table]
    lines += [
        _calibration_line(found),
        "",
        *_where_maps_are_known(table, cases, classes),
        "Confident wrong names: "
        + (", ".join(f"{c.name} {n}" for c in cases for n in c.wrong_confident) or "none")
        + ".",
        "",
    ]
    numbers = {
        row.label: {**_numbers(row.total), "classes": {name: _numbers(one) for name, one in row.classes.items()}}
        for row in table
    }
    error = {name: asdict(one) for name, one in found.items()}
    return "\n".join(lines), {"rows": numbers, "calibration_error": error, "reliability": reliability(cases)}


def _where_maps_are_known(table: list[Row], cases: list[Judged], classes: FormClasses) -> list[str]:
    """The rows that come out otherwise where a map is judged at the sensing points alone that it says it knows."""
    known = rows([replace(case, where_known=True) for case in cases], classes)
    lines = [f"| {_cell(row)} |" for row, strict in zip(known, table, strict=True) if row.total != strict.total]
    if not lines:
        return []
    said = f"Maps judged at the sensing points that they say they know ({FEWEST_KNOWN} at least), else as above:"
    return [said, "", "| | wanted | all | worst form class |", "| --- | --- | --- | --- |", *lines, ""]


def draw(scores: Scores, path: Path) -> None:
    """Confidence against how often it was right."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5, 5), layout="constrained")
    axes.plot([0, 1], [0, 1], color="0.7", label="calibrated")
    for method, one in scores.items():
        bins = one["reliability"]
        if not bins:
            continue
        axes.plot([b["confidence"] for b in bins], [b["right"] for b in bins], marker="o", label=method)
        for b in bins:
            axes.annotate(
                str(b["count"]), (b["confidence"], b["right"]), (4, -12), textcoords="offset points", fontsize=7
            )
    axes.set(xlabel="stated confidence", ylabel="share of claims that were right", xlim=(0, 1.03), ylim=(-0.03, 1.03))
    axes.legend()
    figure.savefig(path, dpi=120, metadata={"Software": None})
    plt.close(figure)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, help="folder of a seed's results")
    parser.add_argument("--recordings", type=Path, help="check the bytes of the recordings in this folder too")
    options = parser.parse_args()
    try:
        truths = opened(options.results, options.recordings)
        methods = judged(options.results, truths)
    except (seals.SealError, DiagnosisError) as error:
        print(error, file=sys.stderr)
        return 2
    laws = options.results / LEFT
    classes = FormClasses({key: one["left"] for key, one in seals.read_json(laws).items()} if laws.exists() else {})
    pages, scores = [f"# Score of {options.results.name}: {len(truths)} cases, all seals hold", ""], {}
    for method, cases in methods.items():
        text, scores[method] = page(method, cases, classes)
        pages.append(text)
    (options.results / "score.md").write_text("\n".join(pages) + "\n")
    seals.write_json(options.results / "score.json", scores)
    draw(scores, options.results / "reliability.png")
    print("\n".join(pages))
    return 0


if __name__ == "__main__":
    sys.exit(main())
