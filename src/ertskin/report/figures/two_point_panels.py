"""True and estimated force maps of every two-point trial, side by side (paper Fig. 11)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.report.figures.style import GREEN, INK, MAGNITUDE_MAP, ORANGE, styled
from ertskin.report.figures.taxel_map import draw_taxels

Array = NDArray[np.float64]
PAIRS_PER_ROW = 4


@styled
def two_point_panels(taxel_m: Array, true_map_n: Array, estimated_map_n: Array) -> Figure:
    """Trials (N,n): the true map left, the estimate right, with a word whether the sets of taxels agree."""
    rows = -(-len(true_map_n) // PAIRS_PER_ROW)
    figure = Figure(figsize=(2.75 * PAIRS_PER_ROW, 1.42 * rows), layout="constrained")
    # A narrow empty column keeps neighbouring pairs apart.
    grid = figure.add_gridspec(rows, 3 * PAIRS_PER_ROW - 1, width_ratios=([1, 1, 0.12] * PAIRS_PER_ROW)[:-1])
    limits = (0.0, float(max(true_map_n.max(), estimated_map_n.max(), 1e-9)))
    drawn = []
    for trial, maps in enumerate(zip(true_map_n, estimated_map_n, strict=True)):
        row, place = divmod(trial, PAIRS_PER_ROW)
        exact = bool(((maps[0] > 0) == (maps[1] > 0)).all())
        for side, value in enumerate(maps):
            axes = figure.add_subplot(grid[row, 3 * place + side])
            squares = draw_taxels(axes, taxel_m, value, limits, MAGNITUDE_MAP, form="")
            for taxel in np.flatnonzero(value > 0):
                dark = value[taxel] / limits[1] > 0.6
                x_mm, y_mm = 1e3 * taxel_m[taxel]
                colour = "white" if dark else INK
                axes.text(x_mm, y_mm, f"{value[taxel]:.1f}", ha="center", va="center", fontsize=5.5, color=colour)
            axes.set_xticks([])
            axes.set_yticks([])
            drawn.append(axes)
        drawn[-2].set_title(f"{trial + 1} true", fontsize=8)
        drawn[-1].set_title("✓ exact" if exact else "✗ estimate", fontsize=8, color=GREEN if exact else ORANGE)
    bar = figure.colorbar(squares, ax=drawn, shrink=0.6, aspect=30, pad=0.01, label="force / N")
    bar.outline.set_visible(False)  # type: ignore[operator]
    return figure
