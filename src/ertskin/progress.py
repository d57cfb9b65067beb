"""What is said of work a person waits for: bars, and the names of its steps."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


@contextmanager
def counting(title: str) -> Iterator[Callable[[int, int], None]]:
    """A bar on the error stream, drawn from the first ``progress(done, total)`` on; nothing is drawn without one."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    bar = Progress(*columns, TextColumn("left"), TimeRemainingColumn(), console=Console(stderr=True))
    task = bar.add_task(title, total=None, visible=False)

    def progress(done: int, total: int) -> None:
        bar.start()
        bar.update(task, completed=done, total=total, visible=True)

    try:
        yield progress
    finally:
        if bar.tasks[0].visible:
            bar.stop()


@contextmanager
def saying(title: str) -> Iterator[Callable[[str], None]]:
    """Names each step as it begins, on the error stream: in one line of a terminal, else in a line of its own."""
    console = Console(stderr=True)
    if console.is_terminal:
        with console.status(title) as status:
            yield lambda step: status.update(f"{title}: {escape(step)}")
    else:
        yield lambda step: print(f"{title}: {step}", file=sys.stderr, flush=True)
