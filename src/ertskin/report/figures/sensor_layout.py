"""The sensor from above: outline, electrodes, sensing points."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from ertskin.physics.sensor import Sensor
from ertskin.report.figures.style import BLUE, FAINT, INK, ORANGE, panels, styled


@styled
def sensor_layout(sensor: Sensor) -> Figure:
    """Outline, numbered electrodes (pads or stretches of the edge) and taxels, in millimetres."""
    figure, (axes,) = panels(width=4.2, height=4.0)
    axes.fill(*(1e3 * sensor.outline_m.T), facecolor="#f6f6f6", edgecolor=FAINT, lw=0.9)
    axes.plot(*(1e3 * sensor.taxel_m.T), "o", ms=4, color=BLUE, alpha=0.7, mew=0, label="taxel")
    if sensor.electrode_edge_m is None:
        centre_mm = 1e3 * sensor.electrode_center_m
        for (x, y), (w, h) in zip(centre_mm, 1e3 * sensor.electrode_size_m, strict=True):
            axes.add_patch(Rectangle((x - w / 2, y - h / 2), w, h, facecolor=ORANGE, alpha=0.8, lw=0))
    else:
        centre_mm = 1e3 * sensor.electrode_edge_m.mean(axis=1)
        for ends in 1e3 * sensor.electrode_edge_m:
            axes.plot(*ends.T, color=ORANGE, lw=4, solid_capstyle="butt")
    span_mm = np.ptp(1e3 * sensor.outline_m, axis=0).max()
    for number, (x, y) in enumerate(centre_mm):
        axes.annotate(str(number), (x, y), xytext=(4, 4), textcoords="offset points", fontsize=6, color=INK)
    axes.plot([], [], "s", color=ORANGE, label="electrode", ms=5)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    low, high = 1e3 * sensor.extent_m
    axes.set_xlim(low[0] - 0.04 * span_mm, high[0] + 0.04 * span_mm)
    axes.set_ylim(low[1] - 0.04 * span_mm, high[1] + 0.04 * span_mm)
    axes.set_aspect("equal")
    axes.set_xlabel("x / mm")
    axes.set_ylabel("y / mm")
    return figure
