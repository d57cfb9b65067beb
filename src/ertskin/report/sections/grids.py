"""How much the number of sensing points matters: the same networks on several grids, side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ertskin.evaluation.results import MethodResult, metric_names
from ertskin.report.figures.sweep_curves import sweep_curves
from ertskin.report.page import Picture, Row, Section, Table
from ertskin.report.units import METRICS

WORDS = (
    "Every network was trained for its grid's points and judged on the test frames whose contacts lie on them (within "
    "half the points' spacing), so grids may have been judged on different frames; a finer grid has more points to "
    "confuse."
)


def grids(methods: Sequence[MethodResult]) -> Section | None:
    """The section for networks of more than one grid, else None."""
    networks = sorted((one for one in methods if one.kind == "network" and one.grid), key=_points)
    names = list(dict.fromkeys(method.grid for method in networks))
    if len(names) < 2:
        return None
    metrics = [name for name in metric_names(networks) if not name[-1].isdigit()]
    kinds = list(dict.fromkeys(method.family for method in networks))
    by_place = {(method.family, method.grid): method for method in networks}
    rows = [
        Row(((METRICS[metric].label, kind), *(_cell(by_place.get((kind, name)), metric) for name in names)), "network")
        for metric in metrics
        for kind in kinds
    ]
    points = [
        ({"model": method.family, "grid": method.grid}, {name: method.values(name).tolist() for name in metrics})
        for method in networks
    ]
    drawn = Picture.of(sweep_curves(points, metrics), "Each metric by the grid: a dot for each seed.", wide=True)
    table = Table(("metric and network", *names), tuple(rows), "Mean over the seeds; below, their range.")
    frames = ", ".join(f"{name} on {_frames(networks, name)}" for name in names)
    return Section("One grid beside another", (WORDS, f"Test frames: {frames}."), tables=(table,), pictures=(drawn,))


def _points(method: MethodResult) -> int:
    outcome = method.runs[0].outcome
    return 0 if outcome is None else len(outcome.taxel_m)


def _frames(networks: Sequence[MethodResult], grid: str) -> int:
    outcomes = (method.runs[0].outcome for method in networks if method.grid == grid)
    return max((len(outcome.map_n) for outcome in outcomes if outcome is not None), default=0)


def _cell(method: MethodResult | None, name: str) -> tuple[str, str]:
    values = np.array([]) if method is None else method.values(name)
    if not np.isfinite(values).any():
        return "–", ""
    low, high = METRICS[name].text(float(values.min())), METRICS[name].text(float(values.max()))
    return METRICS[name].text(float(values.mean())), "" if low == high else f"{low} to {high}"
