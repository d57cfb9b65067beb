"""True and estimated force maps of every two-point trial, side by side (paper Fig. 11)."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from ertskin.report.figures.style import FAINT, GREEN, MAGNITUDE_MAP, ORANGE, ink_on, panels, styled

Array = NDArray[np.float64]
PAIRS_PER_ROW = 4
GAP = 0.12
"""Space between the maps of a pair, in widths of a map; between pairs it is three times as wide."""


@styled
def two_point_panels(taxel_m: Array, true_map_n: Array, estimated_map_n: Array) -> Figure:
    """Trials (N,n): the true map left, the estimate right, with a word whether the sets of taxels agree.

    All maps share one pair of axes: fourteen trials in axes of their own take seconds to lay out.
    """
    rows = -(-len(true_map_n) // PAIRS_PER_ROW)
    figure, (axes,) = panels(width=10.6, height=1.5 * rows + 0.1)
    unit, cell = _unit_square(taxel_m)
    highest = float(max(true_map_n.max(), estimated_map_n.max(), 1e-9))
    squares, values = [], []
    for trial, maps in enumerate(zip(true_map_n, estimated_map_n, strict=True)):
        row, place = divmod(trial, PAIRS_PER_ROW)
        exact = bool(((maps[0] > 0) == (maps[1] > 0)).all())
        words = ((f"{trial + 1} true", "black"), ("✓ exact", GREEN) if exact else ("✗ estimate", ORANGE))
        for side, (value, (word, colour)) in enumerate(zip(maps, words, strict=True)):
            corner = np.array([place * (2 + 4 * GAP) + side * (1 + GAP), -row * 1.25])
            for (x, y), number in zip(unit + corner, value, strict=True):
                squares.append(Rectangle((x - 0.47 * cell, y - 0.47 * cell), 0.94 * cell, 0.94 * cell))
                values.append(number)
                if number > 0:
                    ink = ink_on(number / highest)
                    axes.text(x, y, f"{number:.1f}", ha="center", va="center", fontsize=5.5, color=ink)
            axes.text(corner[0], corner[1] + 1.03, word, fontsize=8, color=colour, va="bottom")
    drawn = PatchCollection(squares, cmap=mpl.colormaps[MAGNITUDE_MAP], edgecolor=FAINT, linewidth=0.4)
    drawn.set_array(np.array(values))
    drawn.set_clim(0.0, highest)
    axes.add_collection(drawn)
    axes.set_xlim(-0.02, PAIRS_PER_ROW * (2 + 4 * GAP) - 2.9 * GAP)
    axes.set_ylim(-1.25 * (rows - 1) - 0.02, 1.2)
    axes.set_aspect("equal")
    axes.set_axis_off()
    bar = figure.colorbar(drawn, ax=axes, shrink=0.6, aspect=30, pad=0.01, label="force / N")
    bar.outline.set_visible(False)  # type: ignore[operator]
    return figure


def _unit_square(taxel_m: Array) -> tuple[Array, float]:
    """Taxels (n,2) moved into the unit square, and the side of a taxel's cell there."""
    apart_m = np.linalg.norm(taxel_m[:, None] - taxel_m, axis=-1)
    pitch_m = apart_m[~np.eye(len(taxel_m), dtype=bool)].min() if len(taxel_m) > 1 else 1.0
    low_m = taxel_m.min(axis=0) - pitch_m / 2
    span_m = float((taxel_m.max(axis=0) + pitch_m / 2 - low_m).max())
    return (taxel_m - low_m) / span_m, pitch_m / span_m
