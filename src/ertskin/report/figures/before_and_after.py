"""Errors of networks before and after a change, one line for each metric."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from ertskin.report.figures.style import BLUE, FAINT, in_lines, panels, styled

Array = NDArray[np.float64]
LEAST = 0.01
"""In millimetres or newton: where every answer is a taxel's centre what is left is rounding, and would set the axis."""


@styled
def before_and_after(names: list[str], labels: list[str], values: Array) -> Figure:
    """``values`` (n,2,m): of network, before or after, and metric, in the metric's own unit, NaN for none."""
    figure, axes = panels(len(names), width=4.6, height=0.3 * len(labels) + 1.0)
    place = np.arange(len(labels))[::-1]
    # Whole decades, the same for all: their ends are labelled however small a change is.
    decades = np.log10(np.maximum([np.nanmin(values), np.nanmax(values)], LEAST))
    low_end, high_end = 10.0 ** np.floor(decades[0]), 10.0 ** (np.floor(decades[1]) + 1.0)
    for number, (axis, name) in enumerate(zip(axes, names, strict=True)):
        before, after = np.maximum(values[number], LEAST)
        for y, low, high in zip(place, before, after, strict=True):
            axis.plot([low, high], [y, y], lw=1.2, color=BLUE)
        axis.plot(before, place, "o", ms=6, color=BLUE, fillstyle="none", label="without")
        axis.plot(after, place, "o", ms=6, color=BLUE, label="with")
        axis.set_xscale("log")
        axis.set_xlim(0.8 * low_end, high_end)
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_yticks(place, labels if number == 0 else [""] * len(labels))
        axis.grid(axis="y", color=FAINT, lw=0.4)
        axis.set(title=in_lines(name, 44), xlabel="error, in the unit of its line")
    axes[0].legend()
    return figure
