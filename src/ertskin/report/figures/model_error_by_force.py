"""Error of the modelled voltage change against force (paper Fig. 8 b)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.report.figures.style import BLUE, FAINT, ORANGE, panels, styled

Array = NDArray[np.float64]


@styled
def model_error_by_force(force_n: Array, rmse_v: Array, noise_v: float | None = None) -> Figure:
    """Frames (N,) as points, their mean in eight equally filled bins, and the noise where it is known."""
    figure, (axes,) = panels()
    axes.plot(force_n, 1e3 * rmse_v, ".", ms=4, mew=0, color=FAINT, label="one frame")
    bins = np.array_split(np.argsort(force_n), min(8, len(force_n)))
    middle = [force_n[rows].mean() for rows in bins]
    axes.plot(middle, [1e3 * rmse_v[rows].mean() for rows in bins], "o-", ms=4, color=BLUE, label="mean")
    if noise_v is not None:
        axes.axhline(1e3 * noise_v, color=ORANGE, lw=0.9, ls="--", label="reading noise")
    axes.set_ylim(bottom=0)
    axes.set_xlim(left=0)
    axes.set_xlabel("force / N")
    axes.set_ylabel("RMSE of the voltage change / mV")
    axes.legend()
    return figure
