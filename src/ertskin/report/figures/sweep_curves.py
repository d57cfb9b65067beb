"""Every metric against what a sweep varied."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ertskin.report.figures.style import SERIES, styled
from ertskin.report.units import METRICS

COLUMNS = 3
Point = tuple[Mapping[str, str], Mapping[str, Sequence[float]]]
"""What was swept, by setting, and each metric's values over the seeds."""


@styled
def sweep_curves(points: Sequence[Point], metrics: Sequence[str]) -> Figure:
    """A panel for each of ``metrics``: a dot for each job, a line through the means.

    Along the axis is the setting with most values; each combination of the others has a line of its own.
    """
    # Of several with as many values a network is no axis: it is compared along one.
    values = {key: len({varied[key] for varied, _ in points}) for key in points[0][0]}
    along = max(values, key=lambda key: (values[key], key != "model"), default=None)
    rows = -(-len(metrics) // COLUMNS)
    figure = Figure(figsize=(3.3 * COLUMNS, 2.4 * rows + 0.5), layout="constrained")
    panels = np.atleast_1d(figure.subplots(rows, COLUMNS, squeeze=False)).ravel()
    for axes, metric in zip(panels, metrics, strict=False):
        _panel(axes, points, along, metric)
    for axes in panels[len(metrics) :]:
        axes.set_axis_off()
    handles, labels = panels[0].get_legend_handles_labels()
    if len(labels) > 1:
        figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 4))
    return figure


def _panel(axes: Axes, points: Sequence[Point], along: str | None, metric: str) -> None:
    known = METRICS.get(metric)
    factor = known.factor if known else 1.0
    ticks = list(dict.fromkeys(varied[along] for varied, _ in points)) if along else ["all"]
    lines: dict[str, list[tuple[int, list[float]]]] = {}
    for varied, values in points:
        name = ", ".join(value for key, value in varied.items() if key != along)
        at = ticks.index(varied[along]) if along else 0
        lines.setdefault(name, []).append((at, [factor * value for value in values.get(metric, [])]))
    for number, (name, drawn) in enumerate(lines.items()):
        color = SERIES[number % len(SERIES)]
        filled = sorted((at, values) for at, values in drawn if values)
        axes.plot([at for at, _ in filled], [np.mean(values) for _, values in filled], color=color, label=name)
        dots = [(at, value) for at, values in filled for value in values]
        axes.plot([at for at, _ in dots], [value for _, value in dots], "o", color=color, ms=4, mew=0)
    axes.set_xticks(range(len(ticks)), ticks)
    axes.set_xlabel(along.rpartition(".")[2] if along else "")
    axes.set_title(known.label if known else metric)
