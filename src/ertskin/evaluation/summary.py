"""The table of an evaluation on the terminal, narrow enough for eighty columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.console import Console

from ertskin import terminal_table
from ertskin.evaluation.results import PAPER, MethodResult, metric_names
from ertskin.report.units import CONTACTS, METRICS, Metric
from ertskin.terminal_table import Column, Row

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
    columns = [Column("method", words=True)]
    columns += [Column(f"{_short(name)}\n{METRICS[name].unit}") for name in names]
    rows = []
    if any(name in PAPER for name in names):
        paper = (METRICS[name].text(PAPER[name][0]) if name in PAPER else "–" for name in names)
        rows.append(Row(("as published", *paper), ends=True))
    for method in methods:
        cells = (_cell(method.values(name), METRICS[name]) for name in names)
        rows.append(Row((method.name, *cells), "bold" if method.kind == "network" else ""))
    terminal_table.print_table(console, columns, rows, caption)


def _short(name: str) -> str:
    """A metric's short heading without the number of contacts, which the caption says."""
    return METRICS[name].short.removesuffix(f" {name[-1]}")


def _cell(values: np.ndarray, metric: Metric) -> str:
    if not len(values):
        return "–"
    mean = metric.text(float(values.mean()))
    narrow = metric.digits != 2 and metric.factor == 1.0  # correlation and place: the report has their spread
    return mean if len(values) == 1 or mean == "–" or narrow else f"{mean}±{metric.text(float(values.std(ddof=1)))}"
