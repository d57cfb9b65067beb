"""Error against the number of calibration presses, in the report's look."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ertskin.report.figures.style import SERIES, panels, styled

MEASURES = {"location_error_mm_1": "place / mm", "force_error_n_1": "force / N"}
LINES = {
    ("none", "chosen", False): "chosen",
    ("none", "gridded", False): "gridded",
    ("none", "random", False): "random, three draws",
    ("of_these", "chosen", False): "chosen and diagnosed",
    ("of_these", "chosen", True): "the same, network trained on them",
    ("of_all", "all", False): "all, diagnosed",
}


@styled
def force_against_presses(curves: dict[str, dict[str, Any]]) -> Figure:
    """Place and force of one contact by rig, one line for each way of choosing; the last point has all presses."""
    figure, panel = panels(2 * len(curves), width=4.4)
    pairs = [(rig, measure) for rig in curves for measure in MEASURES]
    for axes, (rig, measure) in zip(panel, pairs, strict=True):
        for colour, (line, name) in zip(SERIES, LINES.items(), strict=False):
            points = [p for p in curves[rig]["points"] if _on(line, p)]
            counts = sorted({len(p["presses"]) for p in points})
            errors = [np.mean([p["scores"][measure] for p in points if len(p["presses"]) == n]) for n in counts]
            if counts:
                # A ring, where the point of another line may lie within.
                style = {"ms": 8, "mfc": "none"} if line[2] else {"ms": 4}
                axes.plot(counts, errors, "o-", color=colour, label=name, **style)
        axes.set_xscale("log")
        axes.set_ylim(bottom=0.0)
        axes.set_xticks([1, 2, 3, 6, 12, 36], labels=["1", "2", "3", "6", "12", "36"])
        axes.minorticks_off()
        axes.set_xlabel("calibration presses")
        axes.set_ylabel(f"{rig}, error of one contact, {MEASURES[measure]}")
    panel[0].legend(loc="lower left")
    return figure


def _on(line: tuple[str, str, bool], point: dict[str, Any]) -> bool:
    """Whether a point belongs to a line: an undiagnosed one ends with all presses."""
    same = (point["effects"], point["retrained"]) == (line[0], line[2])
    return same and point["way"] in (line[1], "all" if line[0] == "none" else line[1])
