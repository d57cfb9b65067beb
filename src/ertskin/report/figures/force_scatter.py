"""Estimated against true force, one contact (paper Fig. 10 b)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.report.figures.style import BLUE, FAINT, INK, ORANGE, panels, styled

Array = NDArray[np.float64]


@styled
def force_scatter(true_n: Array, estimated_n: Array, missed: NDArray[np.bool_], title: str = "") -> Figure:
    """Frames (N,): estimate at the touched taxel; ``missed`` frames, whose taxel wasn't declared, lie at 0 N."""
    figure, (axes,) = panels(width=4.0, height=3.7)
    top = 1.05 * max(float(true_n.max()), float(estimated_n.max()))
    axes.plot([0, top], [0, top], color=FAINT, lw=0.9, zorder=0)
    axes.plot(true_n[~missed], estimated_n[~missed], ".", ms=5, mew=0, color=BLUE, alpha=0.6, label="found")
    if missed.any():
        axes.plot(true_n[missed], estimated_n[missed], "x", ms=5, color=ORANGE, label="missed", clip_on=False)
        axes.legend(loc="lower right")
    rmse_n = np.sqrt(np.mean((true_n - estimated_n) ** 2))
    words = f"RMSE {rmse_n:.2g} N"
    if np.ptp(true_n) > 0 and np.ptp(estimated_n) > 0:
        words += f", r {np.corrcoef(true_n, estimated_n)[0, 1]:.3f}"
    axes.text(0.03, 0.97, words, transform=axes.transAxes, va="top", color=INK)
    axes.set_xlim(0, top)
    axes.set_ylim(0, top)
    axes.set_aspect("equal")
    axes.set_xlabel("true force / N")
    axes.set_ylabel("estimated force / N")
    axes.set_title(title)
    return figure
