"""One number per taxel, drawn where the taxel lies."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from ertskin.report.figures.style import ERROR_MAP, FAINT, ink_on, panels, styled

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""What is less than this, in any unit shown, is zero."""


def draw_taxels(
    axes: Axes,
    taxel_m: Array,
    value: Array,
    limits: tuple[float, float],
    colours: str = ERROR_MAP,
    form: str = "{:.2g}",
) -> PatchCollection:
    """Squares of one pitch round the taxels (n,2), coloured and lettered by ``value`` (n,); NaN stays blank."""
    taxel_mm = 1e3 * taxel_m
    apart_mm = np.abs(taxel_mm[:, None] - taxel_mm).max(axis=-1)  # So that squares side by side never overlap.
    pitch_mm = apart_mm[~np.eye(len(taxel_mm), dtype=bool)].min() if len(taxel_mm) > 1 else 10.0
    corners = taxel_mm - 0.47 * pitch_mm
    squares = PatchCollection([Rectangle((x, y), 0.94 * pitch_mm, 0.94 * pitch_mm) for x, y in corners])
    squares.set_array(np.ma.masked_invalid(value))
    squares.set_cmap(mpl.colormaps[colours].with_extremes(bad="none"))
    squares.set_clim(*limits)
    squares.set_edgecolor(FAINT)
    squares.set_linewidth(0.5)
    axes.add_collection(squares)
    span = max(limits[1] - limits[0], 1e-30)
    for (x, y), number in zip(taxel_mm, value, strict=True):
        if form and np.isfinite(number):
            darkness = (number - limits[0]) / span
            axes.text(
                x,
                y,
                form.format(number if abs(number) > ROUNDING else 0.0),
                ha="center",
                va="center",
                fontsize=7,
                color=ink_on(darkness),
            )
    low, high = corners.min(axis=0), taxel_mm.max(axis=0) + 0.47 * pitch_mm
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.spines[:].set_visible(False)
    return squares


@styled
def taxel_map(
    taxel_m: Array,
    value: Array,
    label: str,
    limits: tuple[float, float] | None = None,
    colours: str = ERROR_MAP,
    form: str = "{:.2g}",
    title: str = "",
) -> Figure:
    """Heatmap of ``value`` (n,) at ``taxel_m`` (n,2); ``label`` names the quantity and its unit."""
    figure, (axes,) = panels(width=4.4, height=3.7)
    known = value[np.isfinite(value)]
    top = float(known.max()) if known.size else 1.0
    squares = draw_taxels(axes, taxel_m, value, limits or (0.0, top if top > ROUNDING else 1.0), colours, form)
    axes.set_xlabel("x / mm")
    axes.set_ylabel("y / mm")
    axes.set_title(title)
    bar = figure.colorbar(squares, ax=axes, shrink=0.85, label=label)
    bar.outline.set_visible(False)  # type: ignore[operator]
    return figure
