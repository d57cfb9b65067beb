"""The tank study's figures."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.diagnosis.tank.figures import draw_map
from ertskin.diagnosis.tank.inclusions import InclusionMap
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]


def maps_figure(
    sensor: Sensor, maps: dict[int, dict[str, InclusionMap]], truths: dict[int, tuple[Array, Array]]
) -> Figure:
    """Every method's map of every frame, the true outlines over them."""
    names = list(next(iter(maps.values())))
    figure = Figure(figsize=(3.4 * len(names) + 1, 3.5 * len(maps)), layout="constrained")
    axes = figure.subplots(len(maps), len(names), squeeze=False)
    for row, (frame, mine) in zip(axes, maps.items(), strict=True):
        place, sign = truths[frame]
        for axis, name in zip(row, names, strict=True):
            image = draw_map(axis, sensor, mine[name])
            axis.tricontour(*1e3 * place[::3].T, sign[::3], levels=[-0.5, 0.5], colors="k", linewidths=0.9)
            axis.set_title(f"frame {frame}\n{name}", fontsize=8)
    ticks = (0.1, 0.3, 1, 3, 10)
    bar = figure.colorbar(image, ax=axes.ravel().tolist(), label="conductivity over the empty tank's", shrink=0.6)
    bar.set_ticks([float(np.log(t)) for t in ticks], labels=[f"{t:g}" for t in ticks])
    return figure


def curve_figure(path: dict[int, list[dict[str, Any]]], chosen: list[float]) -> Figure:
    """Misfit against variation along the weights (the L-curve), and the correlation with the truth."""
    figure = Figure(figsize=(8.6, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for (frame, points), weight in zip(path.items(), chosen, strict=True):
        (line,) = left.loglog(
            [p["variation"] for p in points], [p["misfit"] for p in points], "o-", ms=4, label=f"frame {frame}"
        )
        right.semilogx([p["weight"] for p in points], [p["correlation"] for p in points], "o-", ms=4)
        right.axvline(weight, color=line.get_color(), lw=0.8, ls=":")
    left.set(xlabel="total variation", ylabel="misfit")
    left.legend()
    right.set(xlabel="weight (dotted: chosen by the readings)", ylabel="correlation with the truth")
    return figure
