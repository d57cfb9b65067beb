"""Share of exactly located one-point frames against force: where light touches are lost."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.report.figures.style import SERIES, in_lines, panels, styled

Array = NDArray[np.float64]


@styled
def hit_rate_by_force(force_n: Array, hits: dict[str, NDArray[np.bool_]], bins: int = 8) -> Figure:
    """Frames (N,) in ``bins`` equally filled bins of force; one line per method with ``hits[method]`` (N,)."""
    figure, (axes,) = panels(width=5.8)
    groups = np.array_split(np.argsort(force_n), min(bins, len(force_n)))
    middle = [force_n[rows].mean() for rows in groups]
    for number, (name, hit) in enumerate(hits.items()):
        share = [100 * hit[rows].mean() for rows in groups]
        turn, colour = divmod(number, len(SERIES))
        dashes = ("-", "--", ":")[turn % 3]
        axes.plot(middle, share, "o", ls=dashes, ms=3.5, color=SERIES[colour], label=in_lines(name))
    axes.set_ylim(-2, 102)
    axes.set_xlim(left=0)
    axes.set_xlabel("true force / N")
    axes.set_ylabel("hit rate / %")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    return figure
