"""Force against commanded depth: what the load cell read, what the calibrated pad says (paper III-B)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.report.figures.style import BLUE, FAINT, INK, ORANGE, panels, styled

Array = NDArray[np.float64]


@styled
def force_depth(
    depth_m: Array,
    force_n: Array,
    model_depth_m: Array | None = None,
    model_force_n: Array | None = None,
    unloading: NDArray[np.bool_] | None = None,
    rigid_depth_m: Array | None = None,
    rigid_force_n: Array | None = None,
) -> Figure:
    """Points measured (N,), the model's line, and the rigid block's line from which the support's stiffness comes."""
    figure, (axes,) = panels()
    up = np.zeros(len(depth_m), dtype=bool) if unloading is None else unloading
    axes.plot(1e3 * depth_m[~up], force_n[~up], ".", ms=6, color=BLUE, alpha=0.5, label="measured, loading", mew=0)
    if up.any():
        axes.plot(1e3 * depth_m[up], force_n[up], ".", ms=6, color=FAINT, label="measured, unloading", mew=0)
    if rigid_depth_m is not None and rigid_force_n is not None:
        axes.plot(1e3 * rigid_depth_m, rigid_force_n, "--", color=INK, lw=0.9, label="rigid block")
        axes.set_ylim(-0.05 * force_n.max(), 1.3 * force_n.max())
    if model_depth_m is not None and model_force_n is not None:
        axes.plot(1e3 * model_depth_m, model_force_n, color=ORANGE, label="model")
    axes.set_xlabel("commanded depth / mm")
    axes.set_ylabel("force / N")
    axes.legend(loc="lower right")
    return figure
