"""Measured and modelled voltage change of the worst and the best frame (paper Fig. 8 c)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.report.figures.style import BLUE, ORANGE, panels, styled

Array = NDArray[np.float64]


@styled
def model_error_cases(measured_v: Array, model_v: Array, names: tuple[str, str]) -> Figure:
    """Changes (2,R) of the frame with the largest error, then of the one with the smallest, named in ``names``."""
    figure, axes = panels(1, 2, width=8.4, height=2.1)
    for axis, kind, name, measured, model in zip(axes, ("worst", "best"), names, measured_v, model_v, strict=True):
        axis.plot(1e3 * measured.ravel(), color=BLUE, lw=0.4, label="measured")
        axis.plot(1e3 * model.ravel(), color=ORANGE, lw=0.4, alpha=0.7, label="model")
        axis.set_title(f"{kind}: {name}, {1e3 * np.sqrt(np.mean((measured - model) ** 2)):.3g} mV rms")
        axis.set_ylabel("change / mV")
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=2, handlelength=1.2)
    axes[1].set_xlabel("reading")
    return figure
