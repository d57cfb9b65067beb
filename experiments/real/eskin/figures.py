"""The study's pictures, in the report's look."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.report.figures.style import BLUE, INK, ORANGE, SERIES, panels, styled

Array = NDArray[np.float64]


@styled
def error_distribution(errors_mm: dict[str, Array]) -> Figure:
    """Share of held-out touches within a distance, one line per method."""
    figure, (axes,) = panels(width=4.8)
    for number, (name, errors) in enumerate(errors_mm.items()):
        axes.plot(np.sort(errors), 100 * np.arange(1, len(errors) + 1) / len(errors), color=SERIES[number], label=name)
    axes.set_xscale("log")
    axes.set_xlim(0.1, 80)
    axes.set_ylim(0, 100)
    axes.set_xlabel("location error / mm")
    axes.set_ylabel("touches within / %")
    axes.legend(loc="lower right")
    return figure


@styled
def error_map(place_mm: Array, said_mm: Array) -> Figure:
    """A line from every true place to where it was said to be."""
    figure, (axes,) = panels(width=4.6, height=4.4)
    for start, end in zip(place_mm, said_mm, strict=True):
        axes.plot(*np.transpose([start, end]), color=ORANGE, lw=0.9)
    axes.plot(*place_mm.T, ".", ms=4, mew=0, color=BLUE)
    axes.set_aspect("equal")
    axes.set_xlabel("x / mm")
    axes.set_ylabel("y / mm")
    axes.tick_params(colors=INK)
    return figure


@styled
def touches_needed(found: dict[str, dict[str, dict[str, list[float]]]]) -> Figure:
    """Mean error against the number of touches learned from, afresh and from the other skin's network."""
    figure, panel = panels(len(found), width=3.6)
    for axes, (name, curves) in zip(panel, found.items(), strict=True):
        for colour, (way, points) in zip((BLUE, ORANGE), curves.items(), strict=True):
            counts = sorted(int(count) for count in points if count != "0")
            axes.plot(counts, [np.mean(points[str(count)]) for count in counts], "o-", ms=4, color=colour, label=way)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_title(name)
        axes.set_xlabel("touches of the new skin")
        axes.set_ylabel("location error / mm")
        axes.legend()
    return figure
