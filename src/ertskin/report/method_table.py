"""The table with every method, the paper's numbers on top."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ertskin.evaluation.results import PAPER, MethodResult, metric_names
from ertskin.report.page import Row, Table
from ertskin.report.units import METRICS

CAPTION = (
    "Large: mean over the seeds. Below: mean ± standard deviation over the taxels, then the range over the seeds "
    "where they differ. A hit is exact: the set of taxels declared equals the true one. Force is read at "
    "the taxel truly touched; a missed contact counts as 0 N. After the ± the paper gives its own spread."
)

ANYWHERE_CAPTION = (
    "Said contacts are assigned to the true ones by least total distance. "
    "Missed and invented: contacts a frame, on average."
)


def method_table(methods: Sequence[MethodResult]) -> Table:
    """A line for the paper, then one for each method; a column for each metric on the taxels."""
    names = [name for name in metric_names(methods) if not name[-1].isdigit()]
    paper = [Row((("as published", "the paper, on its own sensor"), *map(_paper_cell, names)), "paper")]
    return _table(methods, names, paper, CAPTION)


def anywhere_table(methods: Sequence[MethodResult], count: int) -> Table:
    """A line for each method; a column for each metric of ``count`` contacts anywhere."""
    return _table(methods, [name for name in metric_names(methods) if name.endswith(f"_{count}")], [], ANYWHERE_CAPTION)


def _table(methods: Sequence[MethodResult], names: list[str], rows: list[Row], caption: str) -> Table:
    heads = ("method", *(METRICS[name].label for name in names))
    methods = [method for method in methods if any(len(method.values(name)) for name in names)]
    rows = rows + [
        Row(((method.name, method.note), *(_cell(method, name) for name in names)), method.kind) for method in methods
    ]
    return Table(heads, tuple(rows), caption)


def _paper_cell(name: str) -> tuple[str, str]:
    value, spread = PAPER.get(name, (None, None))
    if value is None:
        return "–", ""
    metric = METRICS[name]
    return metric.text(value), "" if spread is None else f"± {metric.text(spread)}"


def _cell(method: MethodResult, name: str) -> tuple[str, str]:
    values = method.values(name)
    if not len(values) or not np.isfinite(values).any():
        return "–", ""
    metric = METRICS[name]
    scores = [run.scores[name] for run in method.runs if name in run.scores]
    mean, spread = np.mean([[score.taxel_mean, score.taxel_spread] for score in scores], axis=0)
    small = f"{metric.text(mean)} ± {metric.text(spread)}" if np.isfinite(mean) else ""
    low, high = metric.text(float(values.min())), metric.text(float(values.max()))
    if low != high:
        small += f"\nseeds {low} to {high}"
    return metric.text(float(values.mean())), small.strip()
