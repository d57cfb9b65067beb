"""Error against the number of calibration presses, in the report's look."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ertskin.report.figures.style import SERIES, panels, styled

MEASURES = {"location_error_mm_1": "place / mm", "force_error_n_1": "force / N"}
LINES = {
    ("none", "chosen"): "chosen",
    ("none", "gridded"): "gridded",
    ("none", "random"): "random, three draws",
    ("verdict", "chosen"): "chosen, effects of all 36",
    ("own", "chosen"): "chosen, effects of these",
}


@styled
def force_against_presses(curve: dict[str, Any]) -> Figure:
    """Place and force of one contact, one line for each way of choosing; the last point has all presses."""
    figure, panel = panels(2, width=4.4)
    for axes, (measure, label) in zip(panel, MEASURES.items(), strict=True):
        for colour, ((effects, way), name) in zip(SERIES, LINES.items(), strict=False):
            points = [p for p in curve["points"] if p["effects"] == effects and p["way"] in (way, "all")]
            counts = sorted({len(p["presses"]) for p in points})
            errors = [np.mean([p["scores"][measure] for p in points if len(p["presses"]) == n]) for n in counts]
            if counts:
                axes.plot(counts, errors, "o-", ms=4, color=colour, label=name)
        axes.set_xscale("log")
        axes.set_ylim(bottom=0.0)
        axes.set_xticks([1, 2, 3, 6, 12, 36], labels=["1", "2", "3", "6", "12", "36"])
        axes.minorticks_off()
        axes.set_xlabel("calibration presses")
        axes.set_ylabel(f"error of one contact, {label}")
    panel[0].legend(loc="lower left")
    return figure
