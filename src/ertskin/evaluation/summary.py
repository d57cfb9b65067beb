"""The table of an evaluation on the terminal, narrow enough for eighty columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from ertskin.evaluation.results import PAPER, MethodResult, metric_names
from ertskin.report.units import CONTACTS, METRICS, Metric

CAPTION = (
    "1: single presses, 2: two weights. hit, exact: the set of taxels is exactly right. "
    "± over seeds; the report has the spread over taxels. novel: frames unlike those trained on, 0.1 % by chance."
)

ANYWHERE_CAPTION = (
    "Said contacts are assigned to true ones by least distance; missed, invented: contacts a frame; "
    "in 90%: stated regions of place and force that hold the contact; novel: frames unlike those trained on, 0.1 % by "
    "chance."
)


def print_table(console: Console, methods: Sequence[MethodResult]) -> None:
    """A line per method, the paper's first: the mean over its seeds, with ± their standard deviation.

    A table for the taxels, and one for each number of contacts anywhere.
    """
    for names, caption in tables(methods):
        _print(console, [m for m in methods if any(len(m.values(name)) for name in names)], names, caption)


def tables(methods: Sequence[MethodResult]) -> list[tuple[list[str], str]]:
    """The metrics that are shown together, and what is said of them."""
    names = metric_names(methods)
    found = [([name for name in names if not name[-1].isdigit()], CAPTION)]
    for count, words in CONTACTS.items():
        found.append(([name for name in names if name.endswith(f"_{count}")], f"Anywhere, {words}. {ANYWHERE_CAPTION}"))
    return [(some, caption) for some, caption in found if some]


def _print(console: Console, methods: Sequence[MethodResult], names: list[str], caption: str) -> None:
    table = Table(
        box=box.SIMPLE_HEAD,
        show_edge=False,
        caption=caption,
        caption_justify="left",
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    table.add_column("method", no_wrap=True)
    for name in names:
        metric = METRICS[name]
        table.add_column(f"{metric.short}\n{metric.unit}", justify="right", no_wrap=True)
    if any(name in PAPER for name in names):
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
