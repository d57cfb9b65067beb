"""One metric of every method on one axis: the mean over seeds as a dot, the spread over seeds as a bar."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.report.figures.style import BLUE, FAINT, INK, ORANGE, in_lines, panels, styled

Array = NDArray[np.float64]


@styled
def method_comparison(
    names: list[str],
    values: list[Array],
    label: str,
    learned: list[bool],
    paper: float | None = None,
) -> Figure:
    """``values[k]`` (S,): one value per seed of method ``names[k]``; learned networks stand out in colour."""
    written = [in_lines(name) for name in names]
    # A row is as high as its name has lines.
    room = np.array([1 + 0.54 * name.count("\n") for name in written])
    figure, (axes,) = panels(width=4.4, height=0.26 * room.sum() + 0.9)
    place = room.sum() - np.cumsum(room) + 0.5 * room
    for y, value, own in zip(place, values, learned, strict=True):
        colour = BLUE if own else INK
        axes.plot(value, np.full(len(value), y), "|", ms=6, color=colour, alpha=0.5)
        axes.plot([value.mean()], [y], "o", ms=5, color=colour)
        axes.plot([value.min(), value.max()], [y, y], lw=0.9, color=colour)
    if paper is not None:
        axes.axvline(paper, color=ORANGE, lw=0.9, ls="--")
        axes.text(paper, room.sum() + 0.05, "published", color=ORANGE, fontsize=7, ha="center", va="bottom")
    axes.set_yticks(place, written)
    axes.set_ylim(-0.1, room.sum() + 0.2)
    axes.grid(axis="y", color=FAINT, lw=0.4)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel(label)
    return figure
