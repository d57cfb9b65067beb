"""What the jobs of a sweep came to: a table on the terminal, the same and a figure on the sweep's run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean, stdev
from typing import TYPE_CHECKING, Any

from ertskin.tracking.run import Run

if TYPE_CHECKING:
    from rich.console import Console

PREFIX = "validation_"


@dataclass(frozen=True)
class JobResult:
    """``varied``: swept setting -> this job's value. ``metrics``: of its validation."""

    varied: dict[str, Any]
    metrics: dict[str, float]


@dataclass(frozen=True)
class Row:
    """Jobs that differ in nothing but the seed: what else was swept, by setting, and each metric's values."""

    varied: dict[str, str]
    metrics: dict[str, list[float]]


def show_sweep(run: Run, results: Sequence[JobResult]) -> None:
    """Print the table, and log it with the figure."""
    from rich.console import Console

    from ertskin.report.figures.sweep_curves import sweep_curves

    rows = rows_of(results)
    print_rows(Console(), rows)
    columns: dict[str, list[Any]] = {key: [row.varied[key] for row in rows] for key in rows[0].varied}
    columns["jobs"] = [max(map(len, row.metrics.values()), default=0) for row in rows]
    for name in _names(rows):
        columns[name] = [_mean(row.metrics.get(name, [])) for row in rows]
    run.columns(columns, "sweep.json")
    run.figure(sweep_curves([(row.varied, row.metrics) for row in rows], _names(rows)), "sweep.png")


def rows_of(results: Sequence[JobResult]) -> list[Row]:
    """One row for each combination of what was swept, the seed aside, in the order of the values."""
    grouped: dict[tuple[str, ...], Row] = {}
    for result in sorted(results, key=lambda result: [_order(value) for value in result.varied.values()]):
        varied = {key: str(value) for key, value in result.varied.items() if key != "seed"}
        row = grouped.setdefault(tuple(varied.values()), Row(varied, {}))
        for name, value in result.metrics.items():
            row.metrics.setdefault(name.removeprefix(PREFIX), []).append(value)
    return list(grouped.values())


def _order(value: Any) -> tuple[float, str]:
    """Numbers by size; grids and other words that begin with one by that, then by the alphabet."""
    digits = str(value).partition("x")[0]
    try:
        return float(digits), str(value)
    except ValueError:
        return 0.0, str(value)


def _names(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(name for row in rows for name in row.metrics))


def _mean(values: Sequence[float]) -> float | None:
    """None where there is none: JSON has no NaN."""
    mean = fmean(values) if values else math.nan
    return mean if math.isfinite(mean) else None


def print_rows(console: Console, rows: Sequence[Row]) -> None:
    """A line for each combination: what was swept, and every metric."""
    from ertskin import terminal_table as terminal
    from ertskin.report.units import METRICS

    names = _names(rows)
    columns = [terminal.Column(key.rpartition(".")[2], words=True) for key in rows[0].varied]
    heads = (f"{METRICS[name].short}\n{METRICS[name].unit}" if name in METRICS else name for name in names)
    columns += [terminal.Column(head) for head in heads]
    lines = [
        terminal.Row((*row.varied.values(), *(_cell(name, row.metrics.get(name, [])) for name in names)))
        for row in rows
    ]
    caption = "validation: simulated presses no network was trained on; ± over seeds"
    terminal.print_table(console, columns, lines, caption)


def _cell(name: str, values: Sequence[float]) -> str:
    from ertskin.report.units import METRICS

    if not values:
        return "–"
    text = METRICS[name].text if name in METRICS else lambda value: f"{value:.4g}"
    return text(fmean(values)) + (f" ±{text(stdev(values))}" if len(values) > 1 else "")
