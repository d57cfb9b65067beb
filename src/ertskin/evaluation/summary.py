"""The table of an evaluation on the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from ertskin.evaluation.results import MethodResult
from ertskin.report.method_table import method_table


def print_table(console: Console, methods: Sequence[MethodResult]) -> None:
    """A line per method, the paper's first; below each value the spread over taxels and the range over seeds."""
    content = method_table(methods)
    table = Table(caption="± over taxels; a hit is the exact set of taxels", caption_justify="left")
    for number, head in enumerate(content.heads):
        table.add_column(head, justify="right" if number else "left", overflow="fold")
    for row in content.rows:
        cells = [main if not small else f"{main}\n[dim]{small}[/dim]" for main, small in row.cells]
        table.add_row(*cells, end_section=True)
    console.print(table)
