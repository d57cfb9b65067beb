"""Tables on a terminal: words wrap over lines, numbers and headings are never cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

LEAST_WORDS = 24
"""A column of words is made no narrower than its longest word, unless that is longer than this."""
GAP = 2
"""Columns between two columns: the box's rule and a space."""


@dataclass(frozen=True)
class Column:
    """A heading, of several lines if it has them; a column of ``words`` wraps, any other one keeps its width."""

    head: str
    words: bool = False


@dataclass(frozen=True)
class Row:
    """A cell for each column; ``ends``: a rule is drawn below."""

    cells: tuple[str, ...]
    style: str = ""
    ends: bool = False


def print_table(console: Console, columns: Sequence[Column], rows: Sequence[Row], caption: str = "") -> None:
    """Print the table, in the console's width; numbers without room go into further tables with the same words."""
    parts = _parts(columns, rows, console.width)
    for part in parts:
        table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
        for k, width in zip(part, _widths(columns, rows, part, console.width), strict=True):
            words = columns[k].words
            table.add_column(
                columns[k].head, width=width, overflow="fold", justify="left" if words else "right", no_wrap=not words
            )
        for row in rows:
            table.add_row(*(Text(row.cells[k]) for k in part), style=row.style, end_section=row.ends)
        console.print(table)
    if caption:
        console.print(Text(caption), style="table.caption")


def _parts(columns: Sequence[Column], rows: Sequence[Row], width: int) -> list[list[int]]:
    """Numbers of the columns that are shown together: those of words every time."""
    words = [k for k, column in enumerate(columns) if column.words]
    room = width - sum(_least(columns, rows, k) + GAP for k in words) + GAP
    parts, left = [words], room
    for k in (k for k, column in enumerate(columns) if not column.words):
        needed = _most(columns, rows, k) + GAP
        if needed > left and len(parts[-1]) > len(words):
            parts, left = [*parts, words], room
        parts[-1] = sorted([*parts[-1], k])
        left -= needed
    return parts


def _widths(columns: Sequence[Column], rows: Sequence[Row], part: Sequence[int], width: int) -> list[int]:
    """Of each column of a part: numbers their own, words the least they need and then what is left."""
    widths = [(_least if columns[k].words else _most)(columns, rows, k) for k in part]
    left = width - sum(widths) - GAP * (len(part) - 1)
    for place in (place for place, k in enumerate(part) if columns[k].words):
        # Where numbers have no room beside the longest word, that is folded.
        more = max(1 - widths[place], min(_most(columns, rows, part[place]) - widths[place], left))
        widths[place] += more
        left -= more
    return widths


def _most(columns: Sequence[Column], rows: Sequence[Row], k: int) -> int:
    """Width of the longest line of a column."""
    texts = [columns[k].head, *(row.cells[k] for row in rows)]
    return max((cell_len(line) for text in texts for line in text.splitlines()), default=1)


def _least(columns: Sequence[Column], rows: Sequence[Row], k: int) -> int:
    """Width of the longest word of a column of words, within ``LEAST_WORDS``."""
    texts = [columns[k].head, *(row.cells[k] for row in rows)]
    return min(LEAST_WORDS, max((cell_len(word) for text in texts for word in text.split()), default=1))
