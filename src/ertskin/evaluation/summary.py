"""The table of an evaluation on the terminal, narrow enough for eighty columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from ertskin.evaluation.results import PAPER, MethodResult, metric_names
from ertskin.report.units import METRICS, Metric

CAPTION = (
    "1: single presses, 2: two weights. hit, exact: the set of taxels is exactly right. "
    "± over seeds; the report has the spread over taxels."
)


def print_table(console: Console, methods: Sequence[MethodResult]) -> None:
    """A line per method, the paper's first: the mean over its seeds, with ± their standard deviation."""
    names = metric_names(methods)
    table = Table(
        box=box.SIMPLE_HEAD,
        show_edge=False,
        caption=CAPTION,
        caption_justify="left",
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    table.add_column("method", no_wrap=True)
    for name in names:
        metric = METRICS[name]
        table.add_column(f"{metric.short}\n{metric.unit}", justify="right", no_wrap=True)
    paper = (METRICS[name].text(PAPER[name][0]) if name in PAPER else "–" for name in names)
    table.add_row("as published", *paper, end_section=True)
    for method in methods:
        cells = (_cell(method.values(name), METRICS[name]) for name in names)
        table.add_row(method.name, *cells, style="bold" if method.kind == "network" else "")
    console.print(table)


def _cell(values: np.ndarray, metric: Metric) -> str:
    if not len(values):
        return "–"
    mean = metric.text(float(values.mean()))
    narrow = metric.digits != 2 and metric.factor == 1.0  # correlation and place: the report has their spread
    return mean if len(values) == 1 or mean == "–" or narrow else f"{mean}±{metric.text(float(values.std(ddof=1)))}"
