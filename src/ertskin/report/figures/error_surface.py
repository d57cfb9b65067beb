"""Error of the indentation depth over the two moduli fitted (paper Fig. 6)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from numpy.typing import NDArray

from ertskin.report.figures.style import ORANGE, SURFACE_MAP, panels, styled
from ertskin.report.words import name_in_words

Array = NDArray[np.float64]


@styled
def error_surface(
    soft_pa: Array,
    stiff_pa: Array,
    error_m: Array,
    best_pa: tuple[float, float],
    names: tuple[str, str] = ("neoprene", "fabric"),
) -> Figure:
    """Contours of ``error_m`` (A,B) over the moduli ``soft_pa`` (A,) and ``stiff_pa`` (B,); a cross at ``best_pa``."""
    figure, (axes,) = panels(width=4.8, height=3.6)
    error_um = 1e6 * error_m
    levels = np.geomspace(max(error_um.min(), 1e-3 * error_um.max()), error_um.max(), 13)
    filled = axes.contourf(1e-3 * soft_pa, 1e-3 * stiff_pa, error_um.T, levels=levels, cmap=SURFACE_MAP, norm="log")
    axes.plot(1e-3 * best_pa[0], 1e-3 * best_pa[1], "+", ms=12, mew=2, color=ORANGE)
    axes.annotate(
        f"{1e-3 * best_pa[0]:.3g}, {1e-3 * best_pa[1]:.3g}",
        (1e-3 * best_pa[0], 1e-3 * best_pa[1]),
        xytext=(8, 6),
        textcoords="offset points",
        color="white",
    )
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(f"modulus of {name_in_words(names[0])} / kPa")
    axes.set_ylabel(f"modulus of {name_in_words(names[1])} / kPa")
    bar = figure.colorbar(filled, ax=axes, label="depth error, rms / µm")
    bar.outline.set_visible(False)  # type: ignore[operator]
    for axis in (axes.xaxis, axes.yaxis, bar.ax.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())
    return figure
